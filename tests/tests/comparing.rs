//! The words of a target beside the host's: every one that differs is found.

use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;
use runtime::decoder::DecoderConstants;
use runtime::frame::CodeWindow;
use runtime::model::Sensitivity;
use runtime::{Decoder, FieldModel, LinearModel, PlanarPose, Temperature};
use tests::compare::{JobError, NAMES, compare, to_bytes, words};
use tests::job::{self, ANSWER_WORDS};
use tests::motion;

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
    temperature: Temperature {
        per_mk: [[-1e-6, 1e-8], [-2e-6, 2e-8], [-3e-6, 3e-8]],
        zero_mc: [21_000, 22_000],
        reach_mk: [30_000, 20_000],
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
