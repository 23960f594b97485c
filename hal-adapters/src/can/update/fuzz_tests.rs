//! A million frames into a node: what reaches the store.

use super::*;

/// A request as a confused or hostile sender makes it, mostly of few tokens and numbers.
fn any_told(random: &mut Random) -> Told {
    let token = random.below(2) as u8;
    if random.below(4) > 0 {
        let index = random.below(152) as u8;
        let index = if index < 147 {
            index
        } else {
            240 + random.below(5) as u8
        };
        // Mostly the right word: only then a transfer gets far.
        let word = match random.below(400) {
            0 => random.bits() as u32,
            _ => word_of(NEW, index.into()).unwrap_or(random.bits() as u32),
        };
        return Told::UpdateData(UpdateData { token, index, word });
    }
    let sequence = 4 + random.below(2) as u32;
    let request = match random.below(900) {
        0..100 => Request::Update(BEGIN),
        100..110 => Request::Update(UpdateRequest::Begin {
            bytes: random.bits() as u16,
        }),
        110..114 => Request::Update(UpdateRequest::Begin { bytes: 0 }),
        114..150 => Request::Update(verify(sequence)),
        150..250 => Request::Update(commit(sequence)),
        250..252 => Request::Update(UpdateRequest::Abort),
        252..253 => Request::ServoOff { seconds: 0 },
        253..400 => Request::ServoOff { seconds: 255 },
        400..500 => Request::Update(UpdateRequest::Challenge {
            part: random.below(4) as u8,
        }),
        500..600 => Request::Update(UpdateRequest::ReadBack {
            index: random.bits() as u8,
        }),
        600..700 => Request::Update(UpdateRequest::Tell {
            page: random.bits() as u8,
        }),
        _ => Request::Update(UpdateRequest::Activate),
    };
    Told::Command(Command::new(request, token))
}

/// A million frames, a tick after every other; how often something was stored. `expected` is the only
/// blob that may be.
fn fuzz(key: Option<Key>, protected_of_8: u64, expected: Option<Vec<u8>>) -> u32 {
    let mut bench = Bench::new(key);
    bench.store.expected = expected;
    let (mut random, mut written) = (Random::new(7), 0);
    for n in 0..1_000_000 {
        let told = any_told(&mut random);
        let mut frame = bench.frame(told);
        if random.below(8) >= protected_of_8 {
            let bytes = random.bits().to_le_bytes();
            frame = BusFrame::new(frame.id, &bytes).expect("eight bytes");
        }
        bench.take(&frame);
        if n % 2 == 0 {
            bench.ticks(1);
        }
        if bench.store.newest_sequence() > 3 {
            written += bench.store.inner.writes();
            bench.store.inner = MemoryStore::holding(3, OLD).expect("sound");
        }
    }
    written
}

#[test]
fn a_million_frames_without_the_key_store_nothing() {
    assert_eq!(fuzz(Some(KEY), 7, None), 0);
}

#[test]
fn a_million_frames_without_a_check_store_nothing() {
    assert_eq!(fuzz(None, 0, None), 0);
}

#[test]
fn of_a_million_frames_to_an_open_node_only_whole_sound_blobs_are_stored() {
    let writes = fuzz(None, 8, Some(NEW.to_vec()));
    std::println!("RESULT update_fuzz_writes={writes}");
    assert!(writes > 10, "{writes}");
}
