//! The host's words of a job, and where the target's differ.

use crate::job::{self, ANSWER_WORDS, Bare, FRAME_WORDS, HEAD_WORDS, Head, PredictingTracker};
use crate::motion::Section;
use runtime::{
    BlobError, Decode, FieldModel, LinearModel, ParameterSet, PoseTracker, RawFrame, Reading,
};

/// Why a job or its answer is refused.
#[derive(Debug, thiserror::Error)]
pub enum JobError {
    /// The file ends within a section, or its head is none.
    #[error("byte {at}: not a section of a job file")]
    NoSection {
        /// Where.
        at: usize,
    },
    /// A section's blob is refused.
    #[error("section {section}: {source}")]
    Blob {
        /// Which, from 0.
        section: usize,
        /// Why.
        source: BlobError,
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
    /// Section of the job, from 0.
    pub section: usize,
    /// Tick of the section, from 0.
    pub tick: usize,
    /// Which word of the answer, by name.
    pub word: &'static str,
    /// The host's.
    pub host: u32,
    /// The target's.
    pub target: u32,
    /// The frame.
    pub frame: RawFrame,
    /// The section's parameters, in bytes.
    pub parameters: Vec<u8>,
}

/// What a comparison found.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Comparison {
    /// Ticks compared.
    pub ticks: usize,
    /// Words that are NaN on either side.
    pub nans: usize,
    /// Ticks in which all is good.
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

/// Does every section of a job file on this machine and compares the target's words.
///
/// # Errors
/// Every variant of [`JobError`].
pub fn compare(file: &[u8], target: &[u8]) -> Result<Comparison, JobError> {
    let mut found = Comparison::default();
    let (mut at, mut answered, mut index) = (0, 0, 0);
    while at < file.len() {
        let (section, end) = section(file, at)?;
        let bytes = section.frames.len() * ANSWER_WORDS * 4;
        let words = target.get(answered..answered + bytes).ok_or({
            JobError::AnswerLength {
                wanted: answered + bytes,
                found: target.len(),
            }
        })?;
        run(&section, index, |tick, frame, reading| {
            found.take(&section, index, tick, frame, reading, words);
        })?;
        (at, answered, index) = (end, answered + bytes, index + 1);
    }
    if answered != target.len() {
        return Err(JobError::AnswerLength {
            wanted: answered,
            found: target.len(),
        });
    }
    Ok(found)
}

/// The section that starts at a byte of a job file, and where it ends.
fn section(file: &[u8], at: usize) -> Result<(Section, usize), JobError> {
    let refused = JobError::NoSection { at };
    let read = || {
        let head = Head::from_words(words::<HEAD_WORDS>(file.get(at..)?)?);
        let parameters_at = at + 4 * HEAD_WORDS;
        let frames_at = parameters_at + 4 * head.parameter_words()?;
        let parameters = file.get(parameters_at..frames_at)?.to_vec();
        let frame_bytes = 4 * FRAME_WORDS;
        let end = frames_at + frame_bytes * usize::try_from(head.frames).ok()?;
        let frames = file.get(frames_at..end)?.chunks_exact(frame_bytes);
        let frames = frames.filter_map(words::<FRAME_WORDS>).map(job::frame);
        let section = Section {
            head,
            parameters,
            frames: frames.collect(),
        };
        Some((section, end))
    };
    read().ok_or(refused)
}

/// Little-endian words from the start of some bytes.
fn words<const N: usize>(bytes: &[u8]) -> Option<[u32; N]> {
    let mut words = [0; N];
    for (word, bytes) in words.iter_mut().zip(bytes.get(..4 * N)?.chunks_exact(4)) {
        *word = u32::from_le_bytes(bytes.try_into().ok()?);
    }
    Some(words)
}

/// Ticks through a section as the image does, and gives each reading to `take`.
///
/// # Errors
///
/// If the blob of the section is refused.
pub fn run(
    section: &Section,
    index: usize,
    mut take: impl FnMut(usize, &RawFrame, Reading),
) -> Result<(), JobError> {
    match section.head.source {
        job::WORDS => {
            run_bare::<LinearModel>(section, take);
            return Ok(());
        }
        job::FIELD_WORDS => {
            run_bare::<FieldModel>(section, take);
            return Ok(());
        }
        _ => {}
    }
    let set = ParameterSet::from_flash(&section.parameters).map_err(|source| JobError::Blob {
        section: index,
        source,
    })?;
    let decoder = set.decoder();
    let mut tracker = PoseTracker::new(decoder, section.head.on_invalid());
    let mut predicting = PredictingTracker::new(tracker.clone());
    for (tick, frame) in section.frames.iter().enumerate() {
        let reading = match section.head.source {
            job::PREDICTED => predicting.tick(frame),
            _ => tracker.tick(frame),
        };
        take(tick, frame, reading);
    }
    Ok(())
}

/// Ticks by a decoder of bare words.
fn run_bare<M: Bare>(section: &Section, mut take: impl FnMut(usize, &RawFrame, Reading)) {
    let (parameters, _) = section.parameters.as_chunks();
    let words: Vec<u32> = parameters.iter().copied().map(u32::from_le_bytes).collect();
    let (decoder, zero) = job::from_words::<M>(&words);
    for (tick, frame) in section.frames.iter().enumerate() {
        take(tick, frame, decoder.decode(frame, &zero));
    }
}

impl Comparison {
    fn take(
        &mut self,
        section: &Section,
        index: usize,
        tick: usize,
        frame: &RawFrame,
        reading: Reading,
        target: &[u8],
    ) {
        let host = job::answer(&reading);
        let bytes = target.get(tick * 4 * ANSWER_WORDS..).unwrap_or_default();
        let target: [u32; ANSWER_WORDS] = words(bytes).unwrap_or_default();
        self.ticks += 1;
        self.good += usize::from(reading.status.is_good());
        for ((word, host), target) in NAMES.into_iter().zip(host).zip(target) {
            let nan = |bits| word != "status" && f32::from_bits(bits).is_nan();
            self.nans += usize::from(nan(host) || nan(target));
            if host == target {
                continue;
            }
            self.differing += 1;
            if self.first.len() < KEPT {
                self.first.push(Difference {
                    section: index,
                    tick,
                    word,
                    host,
                    target,
                    frame: *frame,
                    parameters: section.parameters.clone(),
                });
            }
        }
    }
}

impl core::fmt::Display for Difference {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(
            f,
            "section {}, tick {}: {} is {:08x} ({:e}) on the host and {:08x} ({:e}) on the target; \
             Hall codes {:?}, capacitive codes {:?}, sequence {}; parameters",
            self.section,
            self.tick,
            self.word,
            self.host,
            f32::from_bits(self.host),
            self.target,
            f32::from_bits(self.target),
            self.frame.hall,
            self.frame.capacitive,
            self.frame.sequence,
        )?;
        for word in self.parameters.chunks(4) {
            f.write_str(" ")?;
            for byte in word.iter().rev() {
                write!(f, "{byte:02x}")?;
            }
        }
        Ok(())
    }
}
