extern crate std;
use super::*;
use std::vec::Vec;

/// Frames that carry their number.
fn frames(n: u32) -> Vec<StampedFrame> {
    let frame = |k: u32| {
        let bytes = u64::from(k).to_be_bytes();
        BusFrame::new(Message::Hall.id(), &bytes).expect("eight bytes")
    };
    (0..n)
        .map(|k| StampedFrame {
            time_us: 0,
            frame: frame(k),
        })
        .collect()
}

fn number(frame: &StampedFrame) -> u64 {
    u64::from_be_bytes(frame.frame.data().try_into().expect("eight bytes"))
}

fn run(rates: FaultRates, seed: u64) -> (Vec<StampedFrame>, [u32; 9]) {
    let mut faulty = Faulty::new(frames(20_000).into_iter(), rates, seed);
    let got = faulty.by_ref().collect();
    (got, faulty.injected)
}

#[test]
fn the_same_seed_gives_the_same_faults_and_another_does_not() {
    let rates = FaultRates::each(10_000);
    assert_eq!(run(rates, 7), run(rates, 7));
    assert_ne!(run(rates, 7).0, run(rates, 8).0);
}

#[test]
fn without_rates_nothing_changes() {
    assert_eq!(run(FaultRates::NONE, 1).0, frames(20_000));
}

#[test]
fn dropped_and_repeated_frames_are_counted() {
    let (got, injected) = run(FaultRates::NONE.with(Fault::Drop, 50_000), 1);
    assert_eq!(got.len() as u32 + injected[0], 20_000);
    assert!((800..1200).contains(&injected[0]));
    let (got, injected) = run(FaultRates::NONE.with(Fault::Repeat, 50_000), 1);
    assert_eq!(got.len() as u32, 20_000 + injected[1]);
    let repeats = got.windows(2).filter(|w| w[0] == w[1]).count();
    assert_eq!(repeats as u32, injected[1]);
}

#[test]
fn swapped_frames_move_by_one_and_delayed_ones_by_two_to_nine() {
    for (fault, places) in [(Fault::Swap, 1..=1), (Fault::Delay, 2..=9)] {
        let (got, injected) = run(FaultRates::NONE.with(fault, 5_000), 3);
        assert_eq!(got.len(), 20_000);
        let mut moved = 0;
        for (place, frame) in (0u64..).zip(&got) {
            if number(frame) < place {
                assert!(places.contains(&(place - number(frame))), "{place}");
                moved += 1;
            }
        }
        assert_eq!(moved, injected[fault as usize]);
    }
}

#[test]
fn flips_and_bursts_stay_within_their_size() {
    let mut random = Random::new(5);
    for _ in 0..10_000 {
        assert!((1..=3).contains(&random.mask(Fault::Flip).count_ones()));
        let burst = random.mask(Fault::Burst);
        let length = 64 - burst.leading_zeros() - burst.trailing_zeros();
        assert!((2..=8).contains(&length), "{burst:x}");
    }
}

#[test]
fn a_wrong_length_and_a_wrong_identifier_are_never_right() {
    let mut random = Random::new(5);
    let frame = frames(1)[0].frame;
    for _ in 0..10_000 {
        let length = frame.damaged(Fault::WrongLength, &mut random).dlc();
        assert!(length < 8);
        let renamed = frame.damaged(Fault::WrongId, &mut random);
        assert_ne!(renamed.id, frame.id);
    }
}
