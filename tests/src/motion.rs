//! Sections of a job: the rows of a log, random codes, random terms of the field model.

use crate::job::{self, Head};
use host_fit::input::dataset::Dataset;
use nalgebra::RowVector3;
use rand::{Rng, RngExt};
use runtime::frame::MISSING_CODE;
use runtime::geometry::SensingAxes;
use runtime::model::{FieldProbe, Probes, Sensitivity, Shape};
use runtime::{ModelKind, ParameterSet, RawFrame, Temperature};

/// One section: parameters as they lie in the file, and the frames.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Section {
    /// What the parameters are.
    pub head: Head,
    /// The parameters, in bytes of whole words.
    pub parameters: Vec<u8>,
    /// The frames.
    pub frames: Vec<RawFrame>,
}

/// Every movement of a log as a section, run by a servo from the blob.
///
/// A row of SI columns has no capacitive codes and cannot be put into a frame: such a log
/// gives `None`.
pub fn log_sections(blob: &[u8], dataset: &Dataset, hold: u16) -> Option<Vec<Section>> {
    let frame_of = |row: &host_fit::input::dataset::Row| row.frame.all_codes();
    let section = |movement: &host_fit::input::dataset::Movement| {
        let rows = dataset.rows.get(movement.rows.clone())?;
        let frames = rows.iter().map(frame_of).collect::<Option<Vec<_>>>()?;
        Some(blob_section(blob, frames, hold))
    };
    dataset.movements.iter().map(section).collect()
}

/// Frames run by a servo from a blob.
pub fn blob_section(blob: &[u8], frames: Vec<RawFrame>, hold: u16) -> Section {
    let mut parameters = blob.to_vec();
    parameters.resize(blob.len().next_multiple_of(4), 0xff);
    Section {
        head: Head {
            source: job::BLOB,
            frames: count(&frames),
            hold: hold.into(),
            blob_bytes: count(blob),
        },
        parameters,
        frames,
    }
}

/// A section of a blob with X, Y, Rz predicted.
pub fn predicted(mut section: Section) -> Section {
    section.head.source = job::PREDICTED;
    section
}

fn count<T>(items: &[T]) -> u32 {
    u32::try_from(items.len()).unwrap_or(u32::MAX)
}

/// Codes of a 16-bit converter, each as likely as any other, now and then one missing, with
/// a gap or a repeated number in the sequence here and there. Temperatures are those of a stage at
/// work, now and then missing, or anything.
pub fn uniform_frames(rng: &mut impl Rng, frames: usize) -> Vec<RawFrame> {
    let mut sequence = 0u32;
    let code = |rng: &mut dyn Rng| match rng.random_range(0..200u32) {
        0 => MISSING_CODE,
        _ => rng.random_range(-32768..=32767),
    };
    let frame = |_| {
        sequence = sequence.wrapping_add(match rng.random_range(0..100u32) {
            0 => 0,
            1 => 3,
            _ => 1,
        });
        RawFrame::new(
            std::array::from_fn(|_| code(rng)),
            std::array::from_fn(|_| code(rng)),
            sequence,
            0,
        )
        .with_temperature_mc(std::array::from_fn(|_| match rng.random_range(0..100u32) {
            0 => MISSING_CODE,
            1 => rng.random(),
            2 => rng.random_range(-20_000..60_000),
            _ => rng.random_range(17_000..27_000),
        }))
    };
    (0..frames).map(frame).collect()
}

/// Codes of any 32 bits.
pub fn wild_frames(rng: &mut impl Rng, frames: usize) -> Vec<RawFrame> {
    let frame = |_| job::frame(std::array::from_fn(|_| rng.random()));
    (0..frames).map(frame).collect()
}

/// A probe of the field model with random terms: each adds up to a fiftieth of the signal
/// where that is largest.
fn field_probe(
    rng: &mut impl Rng,
    sensitivity: &Sensitivity<f32>,
    lateral: [f32; 3],
) -> FieldProbe<f32> {
    /// Codes of a displacement of half a millimetre; zr and tilt at the end of their ranges.
    const FULL: f32 = 8e3;
    const HEIGHT: f32 = 0.1;
    const VERTICAL: f32 = 5e-4;
    let mut part = || FULL / 50.0 * rng.random_range(-1.0..1.0f32);
    let mut pair = |full: f32| [part() / full, part() / (full * HEIGHT)];
    FieldProbe {
        sensitivity: *sensitivity,
        shape: Shape {
            u_w_w: pair(FULL * FULL * FULL),
            u_w: pair(FULL * FULL),
            u_z_z: pair(FULL * HEIGHT * HEIGHT),
            u_u_u: pair(FULL * FULL * FULL),
            u_u: pair(FULL * FULL),
            w_w: pair(FULL * FULL),
            w_z: pair(FULL * HEIGHT),
            z_z: pair(HEIGHT * HEIGHT),
            u_u_w: part() / (FULL * FULL * FULL),
            w_w_w: part() / (FULL * FULL * FULL),
        },
        carry: [part() / VERTICAL, part() / VERTICAL, part() / VERTICAL],
        lateral,
    }
}

/// The set with random temperature coefficients, about 20 degC.
pub fn warm_set(rng: &mut impl Rng, set: &ParameterSet) -> ParameterSet {
    let mut set = set.clone();
    let mut pair = || {
        [
            rng.random_range(-2e-6..-1e-6),
            rng.random_range(-2e-7..2e-7),
        ]
    };
    set.constants.temperature = Temperature {
        per_mk: [pair(), pair(), pair()],
        zero_mc: [20_125, 21_250],
        reach_mk: [Temperature::<f32>::REACH_MK; 2],
    };
    set
}

/// The parameter set of Model (31) with random terms of the field model added.
pub fn field_set(rng: &mut impl Rng, set: &ParameterSet) -> ParameterSet {
    let (axes, _) = SensingAxes::from_plane(&set.plane);
    let [a, b, c] = set.probes.sensitivities();
    let [across_a, across_b, across_c] = axes.across();
    let probes = [(a, across_a), (b, across_b), (c, across_c)].map(|(sensitivity, [x, y])| {
        let row = RowVector3::new(x, y, rng.random_range(-0.4..0.4));
        field_probe(rng, sensitivity, (row * set.plane_inverse).into())
    });
    ParameterSet {
        model: ModelKind::Field,
        probes: Probes::Field(probes),
        ..set.clone()
    }
}
