//! The order of a parameter set's values in the blob: text and counts, then all numbers in one
//! row, then the code windows.
//!
//! The numbers are read and written by one loop. Code derived for each of the nested arrays
//! would read the same bytes and take three times the flash.

use crate::decoder::DecoderConstants;
use crate::frame::CodeWindow;
use crate::geometry::ProbeGeometry;
use crate::model::{ModelKind, Sensitivity};
use crate::parameters::{CapacitiveInput, FitRecord, HallInput, ParameterSet, Text};
use core::fmt;
use serde::de::{Error, SeqAccess, Visitor};
use serde::ser::SerializeTuple;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Numbers of a parameter set.
const NUMBERS: usize = 78;

/// The groups of numbers in their order, each with the number of the first after it.
pub(crate) const GROUPS: [(&str, usize); 12] = [
    ("the fit record", 6),
    ("the probe geometry", 12),
    ("PM", 21),
    ("PM^-1", 30),
    ("the scale of the Hall codes", 31),
    ("the capacitive plane matrix", 40),
    ("the scale of the capacitive codes", 41),
    ("the vertical constants", 50),
    ("the sensitivities", 62),
    ("the planar constants", 71),
    ("the calibrated range", 77),
    ("the smallest sensitivity", NUMBERS),
];

/// All numbers of a set, in a row.
pub(crate) struct Numbers(pub(crate) [f32; NUMBERS]);

/// A set in the order of the blob.
#[derive(Serialize, Deserialize)]
pub(crate) struct Layout {
    model: ModelKind,
    serial: Text,
    created: Text,
    logs_sha256: [u8; 32],
    rows: u32,
    train_rows: u32,
    pub(crate) numbers: Numbers,
    hall_window: CodeWindow,
    capacitive_window: CodeWindow,
}

impl Serialize for Numbers {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut tuple = serializer.serialize_tuple(NUMBERS)?;
        for number in &self.0 {
            tuple.serialize_element(number)?;
        }
        tuple.end()
    }
}

impl<'de> Deserialize<'de> for Numbers {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Row;
        impl<'de> Visitor<'de> for Row {
            type Value = Numbers;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("the numbers of a parameter set")
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut row: A) -> Result<Numbers, A::Error> {
                let mut numbers = Numbers([0.0; NUMBERS]);
                for (found, number) in numbers.0.iter_mut().enumerate() {
                    *number =
                        (row.next_element()?).ok_or_else(|| Error::invalid_length(found, &self))?;
                }
                Ok(numbers)
            }
        }
        deserializer.deserialize_tuple(NUMBERS, Row)
    }
}

impl Numbers {
    /// The numbers of a set.
    pub(crate) fn of(set: &ParameterSet) -> Self {
        let mut numbers = Self([0.0; NUMBERS]);
        let mut rest = numbers.0.as_mut_slice();
        let mut put = |from: &[f32]| {
            let here = core::mem::take(&mut rest);
            let Some((to, behind)) = here.split_at_mut_checked(from.len()) else {
                return;
            };
            to.copy_from_slice(from);
            rest = behind;
        };
        let c = &set.constants;
        put(&set.fit.rms);
        put(&set.fit.peak);
        put(&set.geometry.lever_arm_m);
        put(&set.geometry.misalignment_rad);
        put(set.plane.as_flattened());
        put(set.plane_inverse.as_flattened());
        put(&[set.hall.m_per_code]);
        put(set.capacitive.vertical_per_m.as_flattened());
        put(&[set.capacitive.m_per_code]);
        put(c.vertical_per_code.as_flattened());
        for s in &c.sensitivity {
            put(&[s.eta, s.per_z_m, s.per_rx_rad, s.per_ry_rad]);
        }
        put(c.planar_per_code.as_flattened());
        put(&c.calibrated_vertical);
        put(&c.calibrated_planar);
        put(&[c.sensitivity_min]);
        numbers
    }
}

/// The next `N` numbers of a row.
fn next<const N: usize>(rest: &mut &[f32]) -> [f32; N] {
    match rest.split_first_chunk() {
        Some((numbers, behind)) => {
            *rest = behind;
            *numbers
        }
        None => [0.0; N],
    }
}

fn next_rows(rest: &mut &[f32]) -> [[f32; 3]; 3] {
    [next(rest), next(rest), next(rest)]
}

fn next_sensitivity(rest: &mut &[f32]) -> Sensitivity<f32> {
    let [eta, per_z_m, per_rx_rad, per_ry_rad] = next(rest);
    Sensitivity {
        eta,
        per_z_m,
        per_rx_rad,
        per_ry_rad,
    }
}

fn next_one(rest: &mut &[f32]) -> f32 {
    let [number] = next(rest);
    number
}

impl From<&ParameterSet> for Layout {
    fn from(set: &ParameterSet) -> Self {
        Self {
            model: set.model,
            serial: set.serial.clone(),
            created: set.created.clone(),
            logs_sha256: set.logs_sha256,
            rows: set.fit.rows,
            train_rows: set.fit.train_rows,
            numbers: Numbers::of(set),
            hall_window: set.constants.hall_window,
            capacitive_window: set.constants.capacitive_window,
        }
    }
}

impl From<Layout> for ParameterSet {
    fn from(layout: Layout) -> Self {
        let rest = &mut layout.numbers.0.as_slice();
        // Fields are evaluated in the order in which they are written: that of the row.
        Self {
            model: layout.model,
            serial: layout.serial,
            created: layout.created,
            logs_sha256: layout.logs_sha256,
            fit: FitRecord {
                rows: layout.rows,
                train_rows: layout.train_rows,
                rms: next(rest),
                peak: next(rest),
            },
            geometry: ProbeGeometry {
                lever_arm_m: next(rest),
                misalignment_rad: next(rest),
            },
            plane: next_rows(rest),
            plane_inverse: next_rows(rest),
            hall: HallInput {
                m_per_code: next_one(rest),
            },
            capacitive: CapacitiveInput {
                vertical_per_m: next_rows(rest),
                m_per_code: next_one(rest),
            },
            constants: DecoderConstants {
                vertical_per_code: next_rows(rest),
                sensitivity: [
                    next_sensitivity(rest),
                    next_sensitivity(rest),
                    next_sensitivity(rest),
                ],
                planar_per_code: next_rows(rest),
                calibrated_vertical: next(rest),
                calibrated_planar: next(rest),
                sensitivity_min: next_one(rest),
                hall_window: layout.hall_window,
                capacitive_window: layout.capacitive_window,
            },
        }
    }
}
