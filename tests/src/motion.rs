//! Sections of a job: the rows of a log, random codes.

use crate::job::{self, Head};
use host_fit::input::dataset::Dataset;
use rand::{Rng, RngExt};
use runtime::RawFrame;
use runtime::frame::MISSING_CODE;

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
