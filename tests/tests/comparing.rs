//! The words of a target beside the host's: every one that differs is found.

use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;
use runtime::{AnyDecoder, Decode, Decoder, FieldModel, LinearModel, ParameterSet, PlanarPose};
use tests::compare::{JobError, NAMES, compare, to_bytes, words};
use tests::job::{self, ANSWER_WORDS};
use tests::motion;

/// A decoder of the field model with temperatures, and one of Model (31) with its constants.
fn decoders() -> (Decoder<FieldModel>, Decoder<LinearModel>) {
    let blob = include_bytes!("../../runtime/examples/warm.bin");
    let set = ParameterSet::from_bytes(blob).expect("sound");
    let AnyDecoder::Field(field) = set.decoder() else {
        panic!("another model");
    };
    let linear = field.probes().map(|probe| probe.sensitivity);
    // Random codes, too, give good poses.
    let mut constants = *field.constants();
    (constants.calibrated_planar, constants.calibrated_vertical) = ([5e-3; 3], [5e-3; 3]);
    (field, Decoder::new(constants, linear))
}

/// A job of bare words, and what a target without fault answers.
fn job() -> (Vec<u8>, Vec<u8>) {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let (field, linear) = decoders();
    let frames = motion::uniform_frames(&mut rng, 300);
    let wild = motion::wild_frames(&mut rng, 50);
    let sections = [
        motion::word_section(&linear, frames),
        motion::word_section(&motion::odd(&mut rng, &field), wild),
    ];
    let job = to_bytes(&sections);
    let words = words(&job).expect("a job");
    (job, words)
}

#[test]
fn parameters_survive_the_way_through_the_file() {
    let zero = PlanarPose {
        x_m: 1e-6,
        y_m: -2e-6,
        rz_rad: 3e-6,
    };
    let (field, linear) = decoders();
    let mut words = Vec::new();
    job::to_words(&linear, &zero, &mut |word| words.push(word));
    assert_eq!(job::from_words(&words), (linear, zero));
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
        assert_eq!(difference.tick, word / ANSWER_WORDS);
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
            Err(JobError::Stopped { .. } | JobError::AnswerLength { .. })
        ));
    }
}
