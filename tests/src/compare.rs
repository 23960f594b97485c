//! The host's words of a job, and where the target's differ.

use crate::job::{self, ANSWER_WORDS, Stop, Transfer};
use crate::motion::Section;
use runtime::Status;
use std::convert::Infallible;

/// Why a job or its answer is refused.
#[derive(Debug, thiserror::Error)]
pub enum JobError {
    /// The job is not done to its end.
    #[error("after {ticks} ticks: not a job file ({stop:?})")]
    Stopped {
        /// Ticks done.
        ticks: usize,
        /// Why it ends there.
        stop: Stop<Infallible>,
    },
    /// The target gave too few or too many words.
    #[error(
        "the target gave {found} bytes where {wanted} belong: it stopped early, or did another job"
    )]
    AnswerLength {
        /// Bytes that belong there.
        wanted: usize,
        /// Bytes that are there.
        found: usize,
    },
}

/// A word that differs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Difference {
    /// Tick of the job, from 0.
    pub tick: usize,
    /// Which word of the answer, by name.
    pub word: &'static str,
    /// The host's.
    pub host: u32,
    /// The target's.
    pub target: u32,
}

/// What a comparison found.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Comparison {
    /// Ticks compared.
    pub ticks: usize,
    /// Words that are NaN on either side.
    pub nans: usize,
    /// Good ticks.
    pub good: usize,
    /// Words that differ.
    pub differing: usize,
    /// The first of them.
    pub first: Vec<Difference>,
}

/// Differences that are kept in full.
const KEPT: usize = 10;

/// The words of an answer.
pub const NAMES: [&str; ANSWER_WORDS] = ["X", "Y", "Rz", "Z", "Rx", "Ry", "status"];

/// The bytes of a job file.
pub fn to_bytes(sections: &[Section]) -> Vec<u8> {
    let mut bytes = Vec::new();
    for section in sections {
        for word in section.head.to_words() {
            bytes.extend(word.to_le_bytes());
        }
        bytes.extend(&section.parameters);
        for word in section.frames.iter().flat_map(job::frame_words) {
            bytes.extend(word.to_le_bytes());
        }
    }
    bytes
}

/// A job in memory.
struct InMemory<'j> {
    job: &'j [u8],
    words: Vec<u8>,
}

impl Transfer for InMemory<'_> {
    type Fault = Infallible;

    fn read(&mut self, bytes: &mut [u8]) -> Result<bool, Infallible> {
        let next = self.job.split_off(..bytes.len());
        Ok(next.map(|next| bytes.copy_from_slice(next)).is_some())
    }

    fn write(&mut self, bytes: &[u8]) -> Result<(), Infallible> {
        self.words.extend(bytes);
        Ok(())
    }
}

/// The words that this machine gives for a job file, in bytes.
///
/// # Errors
/// [`JobError::Stopped`].
pub fn words(job: &[u8]) -> Result<Vec<u8>, JobError> {
    let words = Vec::new();
    let mut transfer = InMemory { job, words };
    job::run(&mut transfer).map_err(|stop| JobError::Stopped {
        ticks: transfer.words.len() / (4 * ANSWER_WORDS),
        stop,
    })?;
    Ok(transfer.words)
}

/// Does every section of a job file on this machine and compares the target's words.
///
/// # Errors
/// Every variant of [`JobError`].
pub fn compare(file: &[u8], target: &[u8]) -> Result<Comparison, JobError> {
    let host = words(file)?;
    let (wanted, found) = (host.len(), target.len());
    if wanted != found {
        return Err(JobError::AnswerLength { wanted, found });
    }
    let mut found = Comparison {
        ticks: host.len() / (4 * ANSWER_WORDS),
        ..Comparison::default()
    };
    let words = |bytes: &[u8]| {
        bytes
            .as_chunks()
            .0
            .iter()
            .copied()
            .map(u32::from_le_bytes)
            .collect::<Vec<_>>()
    };
    for (k, (host, target)) in words(&host).into_iter().zip(words(target)).enumerate() {
        let (tick, word) = (k / ANSWER_WORDS, NAMES[k % ANSWER_WORDS]);
        let nan = |bits| word != "status" && f32::from_bits(bits).is_nan();
        found.nans += usize::from(nan(host) || nan(target));
        found.good += usize::from(word == "status" && Status::from_bits(host).is_good());
        found.differing += usize::from(host != target);
        if host != target && found.first.len() < KEPT {
            found.first.push(Difference {
                tick,
                word,
                host,
                target,
            });
        }
    }
    Ok(found)
}

impl core::fmt::Display for Difference {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let [host, target] = [self.host, self.target].map(f32::from_bits);
        write!(
            f,
            "tick {}: {} is {:08x} ({host:e}) on the host and {:08x} ({target:e}) on the target",
            self.tick, self.word, self.host, self.target
        )
    }
}
