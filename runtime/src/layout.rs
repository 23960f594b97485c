//! The order of a parameter set's values in the blob: text and counts, then all numbers in one
//! row, then the code windows.
//!
//! [`for_each_row`] is the only list of the numbers: writing, reading and the check that they
//! are finite go through it. A number that is missing there does not compile. Numbers and hash
//! are read by loops: code derived for each of the nested arrays would read the same bytes and
//! take three times the flash.
//!
//! Of the field model's sets three matrices are left out, which follow from the constants of
//! the tick: [`restore`] puts them back. So the largest blob stays within the length up to
//! which its CRC finds any five flipped bits. With temperature coefficients or a motion correction as
//! well, the geometry is left out, too.

use crate::blob::{LAYOUT_VERSION, WITH_TEMPERATURE};
use crate::decoder::DecoderConstants;
use crate::frame::CodeWindow;
use crate::geometry::{ProbeGeometry, SensingAxes};
use crate::matrix::{from_rows, inverse_and_determinant, to_rows};
use crate::model::{FieldProbe, ModelKind, Probes, Sensitivity, Shape};
use crate::motion::MotionCorrection;
use crate::parameters::{
    CapacitiveInput, FitRecord, HallInput, ParameterError, ParameterSet, Text,
};
use core::slice;
use nalgebra::Matrix3;
use serde::{Deserialize, Serialize};

/// What stands before the hash of the logs.
#[derive(Serialize, Deserialize)]
struct Head {
    /// The tag: which model was fitted, and so which coefficients a probe has.
    model: ModelKind,
    serial: Text,
    created: Text,
}

/// What stands between the hash and the numbers: how many rows there are and were fitted.
type Rows = (u32, u32);

/// What stands next from version 3 on: T0 in m degC and the reach in mK, of mount and body.
type Zero = ([i32; 2], [u32; 2]);

/// What stands after the numbers: the windows of the Hall and of the capacitive codes.
type Windows = (CodeWindow, CodeWindow);

/// Visits the numbers of a set in the order of the blob, row by row, with the name of the
/// group that each row belongs to.
#[inline(never)]
fn for_each_row(set: &mut ParameterSet, visit: &mut dyn FnMut(&'static str, &mut [f32])) {
    // Each field is named, so that none is forgotten.
    let ParameterSet {
        model: _,
        serial: _,
        created: _,
        logs_sha256: _,
        fit,
        geometry,
        plane,
        plane_inverse,
        hall: HallInput { m_per_code },
        capacitive,
        probes,
        constants,
        motion_correction,
    } = set;
    let FitRecord {
        rows: _,
        train_rows: _,
        rms,
        peak,
        forced: _,
    } = fit;
    visit("the fit record", rms);
    visit("the fit record", peak);
    let ProbeGeometry {
        lever_arm_m,
        misalignment_rad,
    } = geometry;
    let matrices = matches!(probes, Probes::Linear(_));
    let with_temperature = constants.temperature.is_used();
    if matrices || !(with_temperature || motion_correction.is_some()) {
        visit("the probe geometry", lever_arm_m);
        visit("the probe geometry", misalignment_rad);
    }
    if matrices {
        visit_matrix("PM", plane, visit);
        visit_matrix("PM^-1", plane_inverse, visit);
    }
    visit("the scale of the Hall codes", slice::from_mut(m_per_code));
    let CapacitiveInput {
        vertical_per_m,
        m_per_code,
    } = capacitive;
    if matrices {
        visit_matrix("the capacitive plane matrix", vertical_per_m, visit);
    }
    visit(
        "the scale of the capacitive codes",
        slice::from_mut(m_per_code),
    );
    let DecoderConstants {
        vertical_per_code,
        planar_per_code,
        calibrated_vertical,
        calibrated_planar,
        sensitivity_min,
        hall_window: _,
        capacitive_window: _,
        temperature,
    } = constants;
    visit(
        "the vertical constants",
        vertical_per_code.as_flattened_mut(),
    );
    match probes {
        Probes::Linear(probes) => {
            for sensitivity in probes {
                visit_sensitivity(sensitivity, visit);
            }
        }
        Probes::Field(probes) => {
            for probe in probes {
                visit_field_probe(probe, visit);
            }
        }
    }
    visit("the planar constants", planar_per_code.as_flattened_mut());
    visit("the calibrated range", calibrated_vertical);
    visit("the calibrated range", calibrated_planar);
    visit("the smallest sensitivity", slice::from_mut(sensitivity_min));
    if with_temperature {
        visit(
            "the temperature coefficients",
            temperature.per_mk.as_flattened_mut(),
        );
    }
    if let Some(MotionCorrection {
        acceleration_s2,
        velocity_s,
    }) = motion_correction
    {
        visit("the motion correction", acceleration_s2.as_flattened_mut());
        visit("the motion correction", velocity_s.as_flattened_mut());
    }
}

/// Visits a matrix row by row.
#[inline(never)]
fn visit_matrix(
    group: &'static str,
    matrix: &mut Matrix3<f32>,
    visit: &mut dyn FnMut(&'static str, &mut [f32]),
) {
    let mut rows = to_rows(matrix);
    visit(group, rows.as_flattened_mut());
    *matrix = from_rows(&rows);
}

fn visit_sensitivity(
    Sensitivity {
        eta,
        per_z_m,
        per_rx_rad,
        per_ry_rad,
    }: &mut Sensitivity<f32>,
    visit: &mut dyn FnMut(&'static str, &mut [f32]),
) {
    for number in [eta, per_z_m, per_rx_rad, per_ry_rad] {
        visit("the sensitivities", slice::from_mut(number));
    }
}

fn visit_field_probe(
    FieldProbe {
        sensitivity,
        carry,
        shape,
        lateral,
    }: &mut FieldProbe<f32>,
    visit: &mut dyn FnMut(&'static str, &mut [f32]),
) {
    visit_sensitivity(sensitivity, visit);
    visit("the field terms", carry);
    let Shape {
        u_w_w,
        u_w,
        u_z_z,
        u_u_u,
        u_u,
        w_w,
        w_z,
        z_z,
        u_u_w,
        w_w_w,
    } = shape;
    for pair in [u_w_w, u_w, u_z_z, u_u_u, u_u, w_w, w_z, z_z] {
        visit("the field terms", pair);
    }
    for number in [u_u_w, w_w_w] {
        visit("the field terms", slice::from_mut(number));
    }
    visit("the lateral rows", lateral);
}

/// Computes the matrices that the blob of a field model leaves out. PM^-1 and the capacitive plane
/// matrix are the constants over the scales of the codes. PM is the inverse of PM^-1 and holds the
/// geometry. Unsound constants give unsound matrices, which the checks refuse.
pub(crate) fn restore(set: &mut ParameterSet) {
    if let Probes::Field(_) = set.probes {
        let c = &set.constants;
        set.plane_inverse = from_rows(&c.planar_per_code) / set.hall.m_per_code;
        set.plane = inverse_and_determinant(&set.plane_inverse).0;
        set.capacitive.vertical_per_m = from_rows(&c.vertical_per_code) / set.capacitive.m_per_code;
        if c.temperature.is_used() || set.motion_correction.is_some() {
            let (axes, arms) = SensingAxes::from_plane(&set.plane);
            set.geometry.lever_arm_m = arms;
            set.geometry.misalignment_rad = axes.misalignment_rad();
        }
    }
}

/// Writes the payload of a set and gives its length; `None` if `room` is too small.
pub(crate) fn write(set: &ParameterSet, room: &mut [u8]) -> Option<usize> {
    let head = Head {
        model: set.model,
        serial: set.serial.clone(),
        created: set.created.clone(),
    };
    let rows: Rows = (set.fit.rows, set.fit.train_rows);
    let windows: Windows = (set.constants.hall_window, set.constants.capacitive_window);
    let mut out = Out { room, length: 0 };
    out.put(&head)?;
    for byte in &set.logs_sha256 {
        out.put(byte)?;
    }
    out.put(&rows)?;
    let temperature = &set.constants.temperature;
    if set.layout_version() >= WITH_TEMPERATURE {
        let zero: Zero = (temperature.zero_mc, temperature.reach_mk);
        out.put(&zero)?;
    }
    let mut fits = Some(());
    for_each_row(&mut set.clone(), &mut |_, row| {
        for number in row {
            fits = fits.and_then(|()| out.put(number));
        }
    });
    fits?;
    out.put(&windows)?;
    Some(out.length)
}

/// Values in postcard, one after the other.
struct Out<'r> {
    room: &'r mut [u8],
    length: usize,
}

impl Out<'_> {
    fn put(&mut self, value: &impl Serialize) -> Option<()> {
        let room = self.room.get_mut(self.length..)?;
        self.length += postcard::to_slice(value, room).ok()?.len();
        Some(())
    }
}

/// Reads a payload, which must end where the set does; `None` if it is none. As a function of
/// its own it frees its stack before the checks.
#[inline(never)]
pub(crate) fn read(payload: &[u8], version: u16) -> Option<ParameterSet> {
    let (head, rest) = postcard::take_from_bytes::<Head>(payload).ok()?;
    let (&logs_sha256, rest) = rest.split_first_chunk()?;
    let ((rows, train_rows), mut rest) = postcard::take_from_bytes::<Rows>(rest).ok()?;
    // Zeros where the numbers go.
    let mut set = ParameterSet {
        model: head.model,
        serial: head.serial,
        created: head.created,
        logs_sha256,
        fit: FitRecord {
            rows,
            train_rows,
            ..FitRecord::default()
        },
        geometry: ProbeGeometry::default(),
        plane: Matrix3::zeros(),
        plane_inverse: Matrix3::zeros(),
        hall: HallInput::default(),
        capacitive: CapacitiveInput::default(),
        probes: match head.model {
            ModelKind::M12 | ModelKind::M15 | ModelKind::M30 | ModelKind::M31 => {
                Probes::Linear([Sensitivity::default(); 3])
            }
            ModelKind::Field => Probes::Field([FieldProbe::default(); 3]),
        },
        constants: DecoderConstants::default(),
        motion_correction: (version == LAYOUT_VERSION).then(MotionCorrection::default),
    };
    let temperature = &mut set.constants.temperature;
    if version >= WITH_TEMPERATURE {
        let zero: Zero;
        (zero, rest) = postcard::take_from_bytes(rest).ok()?;
        (temperature.zero_mc, temperature.reach_mk) = zero;
    }
    let mut complete = true;
    for_each_row(&mut set, &mut |_, row| {
        for number in row {
            match rest.split_first_chunk() {
                Some((bytes, behind)) => {
                    *number = f32::from_le_bytes(*bytes);
                    rest = behind;
                }
                None => complete = false,
            }
        }
    });
    let (windows, rest) = postcard::take_from_bytes::<Windows>(rest).ok()?;
    (set.constants.hall_window, set.constants.capacitive_window) = windows;
    restore(&mut set);
    (complete && rest.is_empty()).then_some(set)
}

/// Refuses a number that is not finite, by the name of its group. The set is unchanged.
pub(crate) fn check_finite(set: &mut ParameterSet) -> Result<(), ParameterError> {
    let mut found = Ok(());
    for_each_row(set, &mut |group, row| {
        if found.is_ok() && !row.iter().all(|number| number.is_finite()) {
            found = Err(ParameterError::NotFinite { group });
        }
    });
    found
}
