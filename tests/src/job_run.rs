//! Does a job, on the host and on the target alike.

use super::{
    ANSWER_WORDS, BLOB_WORDS, FRAME_WORDS, HEAD_WORDS, Head, PREDICTED, PredictingTracker, answer,
    frame, motion,
};
use runtime::{BlobError, ParameterSet, PlanarPose, PoseTracker, RawFrame, Reading};

/// Frames of one transfer.
const BATCH: usize = 512;

/// Reads the bytes of a job and writes the bytes of its answer.
pub trait Transfer {
    /// Why bytes do not come or go.
    type Fault;
    /// Fills `bytes` with the next ones of the job; `false` if it has ended before.
    ///
    /// # Errors
    /// The fault of the transfer.
    fn read(&mut self, bytes: &mut [u8]) -> Result<bool, Self::Fault>;
    /// Appends bytes to the answer.
    ///
    /// # Errors
    /// The fault of the transfer.
    fn write(&mut self, bytes: &[u8]) -> Result<(), Self::Fault>;
}

/// Why a job is not done to its end.
#[derive(Debug)]
pub enum Stop<F> {
    /// Bytes that do not come or go.
    Transfer(F),
    /// The file ends within a section, or its head is none.
    NoJob,
    /// A blob is refused.
    Refused(BlobError),
}

impl<F> From<F> for Stop<F> {
    fn from(fault: F) -> Self {
        Self::Transfer(fault)
    }
}

/// Does every section of a job.
///
/// # Errors
/// Every variant of [`Stop`].
pub fn run<T: Transfer>(transfer: &mut T) -> Result<(), Stop<T::Fault>> {
    loop {
        let mut head = [[0; 4]; HEAD_WORDS];
        let [first, rest @ ..] = head.as_flattened_mut() else {
            return Err(Stop::NoJob);
        };
        if !transfer.read(core::slice::from_mut(first))? {
            return Ok(());
        }
        fill(transfer, rest)?;
        let head = Head::from_words(head.map(u32::from_le_bytes));
        let mut bytes = [0; 4 * BLOB_WORDS];
        let length = head.parameter_words().ok_or(Stop::NoJob)? * 4;
        let blob = bytes.get_mut(..length).ok_or(Stop::NoJob)?;
        fill(transfer, blob)?;
        let set = ParameterSet::from_flash(blob).map_err(Stop::Refused)?;
        let mut tracker = PoseTracker::new(set.decoder(), head.on_invalid());
        let mut predicting = PredictingTracker::new(tracker.clone());
        frames(transfer, head.frames, |frame| {
            let mut reading = match head.source {
                PREDICTED => predicting.tick(frame),
                _ => tracker.tick(frame),
            };
            if let Some(correction) = set.motion_correction {
                let corrected = correction.correct(reading.pose.planar, &motion(frame));
                reading.pose.planar = corrected.unwrap_or(PlanarPose::ZERO);
            }
            reading
        })?;
    }
}

fn fill<T: Transfer>(transfer: &mut T, bytes: &mut [u8]) -> Result<(), Stop<T::Fault>> {
    match transfer.read(bytes)? {
        true => Ok(()),
        false => Err(Stop::NoJob),
    }
}

/// Ticks through the frames of one section.
fn frames<T: Transfer>(
    transfer: &mut T,
    count: u32,
    mut tick: impl FnMut(&RawFrame) -> Reading,
) -> Result<(), Stop<T::Fault>> {
    let mut left = usize::try_from(count).map_err(|_| Stop::NoJob)?;
    let mut taken = [[[0u8; 4]; FRAME_WORDS]; BATCH];
    let mut given = [[[0u8; 4]; ANSWER_WORDS]; BATCH];
    while left > 0 {
        let now = left.min(BATCH);
        left -= now;
        let (Some(taken), Some(given)) = (taken.get_mut(..now), given.get_mut(..now)) else {
            return Err(Stop::NoJob);
        };
        fill(transfer, taken.as_flattened_mut().as_flattened_mut())?;
        for (words, words_given) in taken.iter().zip(given.iter_mut()) {
            let frame = frame(words.map(u32::from_le_bytes));
            *words_given = answer(&tick(&frame)).map(u32::to_le_bytes);
        }
        transfer.write(given.as_flattened().as_flattened())?;
    }
    Ok(())
}
