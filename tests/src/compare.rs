//! The host's words of a job, and where the target's differ.

use crate::job::{self, ANSWER_WORDS, Bare, FRAME_WORDS, HEAD_WORDS, Head, PredictingServo};
use crate::motion::Section;
use runtime::{BlobError, Decode, FieldModel, LinearModel, ParameterSet, RawFrame, Reading, Servo};

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

const NAMES: [&str; ANSWER_WORDS] = ["X", "Y", "Rz", "Z", "Rx", "Ry", "status"];

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

/// Ticks through a section as the image does.
fn run(
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
    let mut servo = Servo::new(&*decoder, section.head.on_invalid());
    let mut predicting = PredictingServo::new(servo.clone());
    for (tick, frame) in section.frames.iter().enumerate() {
        let reading = match section.head.source {
            job::PREDICTED => predicting.tick(frame),
            _ => servo.tick(frame),
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion;
    use rand::SeedableRng;
    use rand::rngs::ChaCha8Rng;
    use runtime::decoder::DecoderConstants;
    use runtime::frame::CodeWindow;
    use runtime::model::Sensitivity;
    use runtime::{Decoder, LinearModel, PlanarPose};

    const CONSTANTS: DecoderConstants<f32> = DecoderConstants {
        vertical_per_code: [[1e-8, 2e-8, 3e-8], [4e-8, -5e-8, 6e-8], [7e-8, 8e-8, -9e-8]],
        planar_per_code: [[1e-8, 2e-8, 6e-8], [3e-8, 3e-8, 1e-9], [1e-7, -1e-7, 1e-9]],
        calibrated_vertical: [1e-3; 3],
        calibrated_planar: [2e-3; 3],
        sensitivity_min: 0.1,
        hall_window: CodeWindow {
            low: -32767,
            high: 32766,
        },
        capacitive_window: CodeWindow {
            low: -32766,
            high: 32765,
        },
    };

    const PROBE: Sensitivity<f32> = Sensitivity {
        eta: 0.8,
        per_z_m: -190.0,
        per_rx_rad: -60.0,
        per_ry_rad: 30.0,
    };

    const DECODER: Decoder<LinearModel> = Decoder::new(CONSTANTS, [PROBE; 3]);

    fn field_decoder(rng: &mut ChaCha8Rng) -> Decoder<FieldModel> {
        let lateral = [[0.1, -0.2, 0.9], [0.0, 0.1, -1.0], [1.0, 0.3, 0.2]];
        let probes = lateral.map(|lateral| motion::field_probe(rng, &PROBE, lateral));
        Decoder::new(CONSTANTS, probes)
    }

    /// A job of bare words, and what a target without fault answers.
    fn job() -> (Vec<u8>, Vec<u8>) {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let field = field_decoder(&mut rng);
        let frames = motion::uniform_frames(&mut rng, 300);
        let wild = motion::wild_frames(&mut rng, 50);
        let sections = [
            motion::of_words(&DECODER, frames),
            motion::of_words(&motion::odd(&mut rng, &field), wild),
        ];
        let mut words = Vec::new();
        for (index, section) in sections.iter().enumerate() {
            let take = |_: usize, _: &RawFrame, reading: Reading| {
                words.extend(job::answer(&reading).map(u32::to_le_bytes).as_flattened());
            };
            run(section, index, take).expect("bare words");
        }
        (to_bytes(&sections), words)
    }

    #[test]
    fn parameters_survive_the_way_through_the_file() {
        let zero = PlanarPose {
            x_m: 1e-6,
            y_m: -2e-6,
            rz_rad: 3e-6,
        };
        let mut words = Vec::new();
        job::to_words(&DECODER, &zero, &mut |word| words.push(word));
        assert_eq!(job::from_words(&words), (DECODER, zero));
        let field = field_decoder(&mut ChaCha8Rng::seed_from_u64(4));
        words.clear();
        job::to_words(&field, &zero, &mut |word| words.push(word));
        assert_eq!(words.len(), job::PARAMETER_WORDS);
        assert_eq!(job::from_words(&words), (field, zero));
    }

    #[test]
    fn a_target_that_agrees_differs_in_no_word() {
        let (file, words) = job();
        let found = compare(&file, &words).expect("a job and its answer");
        assert_eq!((found.ticks, found.differing, found.nans), (350, 0, 0));
        assert!(found.good > 0 && found.good < 300);
    }

    #[test]
    fn every_flipped_bit_is_found_with_its_place() {
        let (file, mut words) = job();
        for bit in (0..8 * words.len()).step_by(97) {
            words[bit / 8] ^= 1 << (bit % 8);
            let found = compare(&file, &words).expect("a job and its answer");
            words[bit / 8] ^= 1 << (bit % 8);
            let [difference] = found.first.as_slice() else {
                panic!("bit {bit}: {found:?}")
            };
            let word = bit / 32;
            let tick = word / ANSWER_WORDS;
            let place = if tick < 300 {
                (0, tick)
            } else {
                (1, tick - 300)
            };
            assert_eq!((difference.section, difference.tick), place);
            assert_eq!(difference.word, NAMES[word % ANSWER_WORDS]);
            assert_eq!(difference.host ^ difference.target, 1 << (bit % 32));
        }
    }

    #[test]
    fn an_answer_or_a_job_of_another_length_is_refused() {
        let (file, words) = job();
        for found in [0, 1, words.len() - 1, words.len() - 28] {
            assert!(matches!(
                compare(&file, &words[..found]),
                Err(JobError::AnswerLength { .. })
            ));
        }
        for length in [1, 15, 17, file.len() - 1] {
            assert!(matches!(
                compare(&file[..length], &words),
                Err(JobError::NoSection { .. } | JobError::AnswerLength { .. })
            ));
        }
    }
}
