//! The words of a target beside the host's: every one that differs is found.

use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;
use runtime::RawFrame;
use tests::compare::{NAMES, compare, to_bytes, words};
use tests::job::ANSWER_WORDS;
use tests::motion;

/// A job of random codes with predicted and unpredicted poses, and what a target without fault answers.
fn job() -> (Vec<u8>, Vec<u8>) {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let blob = include_bytes!("../../runtime/examples/warm.bin");
    // A stage at work, so that some poses are good.
    let near = |k: i32| RawFrame::new([k, -k, 17], [k, 5, -k], k as u32, 0);
    let near = (0..50).map(|k| near(k).with_temperature_mc([20_125, 21_250]));
    let frames = motion::uniform_frames(&mut rng, 250);
    let wild = motion::wild_frames(&mut rng, 50);
    let sections = [
        motion::blob_section(blob, near.chain(frames).collect(), 0),
        motion::predicted(motion::blob_section(blob, wild, 0)),
    ];
    let job = to_bytes(&sections);
    let words = words(&job).expect("a job");
    (job, words)
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
