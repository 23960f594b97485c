//! A million frames into a node, half of them what its transfer waits for, from two hosts of which
//! one has the key. The rest is damaged, played again, of the wrong transfer, or at random.

use super::*;

/// A host; the frames that it sends follow from what the node waits for.
struct Host {
    token: u8,
    key: Key,
    blob: Vec<u8>,
    goes_back: bool,
}

impl Host {
    /// What the node waits for from this host, or a question.
    fn next(&self, bench: &Bench, random: &mut Random) -> Told {
        let ask = |request| Told::Command(Command::new(request, self.token));
        let due = bench.store.newest_sequence() + 1;
        if !bench.service.servo_is_off() {
            return ask(Request::ServoOff { seconds: 255 });
        }
        let update = |request| ask(Request::Update(request));
        let blob = if self.goes_back { &[] } else { &self.blob[..] };
        let previous = bench.store.previous().map_or(0, |kept| kept.crc);
        let crc = crc_of(blob).unwrap_or(previous);
        let Some(transfer) = &bench.receiver.transfer else {
            return update(UpdateRequest::begin(blob.len(), crc));
        };
        let is_own = transfer.token == self.token;
        let staging = &bench.receiver.staging;
        let is_keyed = bench.receiver.identity.key.is_some();
        match staging.missing(transfer.bytes, is_keyed) {
            Some(index) if is_own && transfer.commit.is_none() => {
                let own = tag(&self.key, &transfer.nonce, due, blob, crc);
                let word = match index.checked_sub(TAG_INDEX) {
                    Some(k) => word_of(&own, k.into()),
                    None => word_of(blob, index.into()),
                };
                let (token, word) = (self.token, word.unwrap_or(0));
                Told::UpdateData(UpdateData { token, index, word })
            }
            None if is_own => update(commit(due)),
            _ => update(match random.below(3) {
                0 => UpdateRequest::Tell {
                    page: random.bits() as u8,
                },
                1 => UpdateRequest::ReadBack {
                    index: random.bits() as u8,
                },
                _ => UpdateRequest::Challenge {
                    part: random.below(4) as u8,
                },
            }),
        }
    }
}

/// What a confused or hostile sender may send; what ends or spoils a transfer is rare.
fn any_told(random: &mut Random, hosts: &[Host; 2]) -> Told {
    let host = &hosts[random.below(2) as usize];
    let token = hosts[random.below(2) as usize].token;
    let sequence = 3 + random.below(200) as u32;
    let update = Request::Update;
    let request = match random.below(1_000) {
        0 => update(UpdateRequest::Abort),
        1 => Request::ServoOff { seconds: 0 },
        2 => update(UpdateRequest::Activate),
        3..25 => {
            // A word of either's blob, or of none.
            let index = random.below(TAG_INDEX as u64 + 5) as u8;
            let of_blob = word_of(&host.blob, index.into()).filter(|_| random.below(2) == 0);
            let word = of_blob.unwrap_or(random.bits() as u32);
            return Told::UpdateData(UpdateData { token, index, word });
        }
        25..300 => update(UpdateRequest::Begin {
            bytes: random.bits() as u16,
            check: random.bits() as u16,
        }),
        300..900 => update(commit(sequence)),
        _ => Request::ServoOff { seconds: 255 },
    };
    Told::Command(Command::new(request, token))
}

/// How many transfers were opened, refused by their tag or content, stored, and stored to go back;
/// the first of each by the host with the key.
#[derive(Debug, Default, PartialEq, Eq)]
struct Seen {
    opened: [u32; 2],
    refused: [u32; 2],
    stored: [u32; 2],
    back: [u32; 2],
}

impl Seen {
    /// Notes an answer: one that may open a transfer, or end one.
    fn note(&mut self, answer: Answer, opens: bool, ends: bool, bench: &Bench) {
        const BEGIN_NUMBER: u8 = BEGIN.number();
        let who = usize::from(answer.token & 1);
        let outcome = answer.outcome.expect("a known one");
        match (answer.number, outcome) {
            (BEGIN_NUMBER, Outcome::Done) if opens => self.opened[who] += 1,
            (COMMIT, Outcome::NotAuthorised | Outcome::BadContent) if ends => {
                self.refused[who] += 1;
            }
            (COMMIT, Outcome::Done) if ends => {
                self.stored[who] += 1;
                self.back[who] += u32::from(bench.store.went_back);
            }
            _ => {}
        }
    }
}

/// A million frames, a tick after every other.
fn fuzz(key: Option<Key>) -> Seen {
    let mut bench = Bench::new(key);
    let (mut random, mut seen) = (Random::new(7), Seen::default());
    let mut other = ParameterSet::from_bytes(NEW).expect("sound");
    other.fit.rows += 1;
    let mut buffer = [0; MAX_BYTES];
    let other = other.to_bytes(&mut buffer).expect("room");
    let mut hosts = [(2, KEY, NEW), (1, [0; 16], other)].map(|(token, key, blob)| Host {
        token,
        key,
        blob: blob.to_vec(),
        goes_back: false,
    });
    if key.is_none() {
        bench.store.expected.push(other.to_vec());
    }
    let mut last: Vec<BusFrame> = Vec::new();
    for n in 0..1_000_000 {
        let k = random.below(2) as usize;
        let told = match random.below(10) {
            0..7 => hosts[k].next(&bench, &mut random),
            _ => any_told(&mut random, &hosts),
        };
        let mut frame = bench.frame(told);
        match random.below(10) {
            0 => frame = frame.flipped(1 << random.below(64) | 1 << random.below(64)),
            1 => {
                let bytes = random.bits().to_le_bytes();
                frame = BusFrame::new(frame.id, &bytes).expect("eight bytes");
            }
            2 if !last.is_empty() => frame = last[random.below(last.len() as u64) as usize],
            _ => {}
        }
        last.truncate(63);
        last.insert(0, frame);
        let was_updating = bench.receiver.is_updating();
        if let Some(Ok(Told::Answer(answer))) = bench
            .take(&frame)
            .and_then(|coded| Mailbox::default().take(&BusFrame::from(coded)))
        {
            let ended = was_updating && !bench.receiver.is_updating();
            seen.note(answer, !was_updating, ended, &bench);
        }
        if n % 2 == 0 {
            for answer in bench.ticks(1) {
                seen.note(answer, false, true, &bench);
            }
        }
        if !bench.receiver.is_updating() {
            hosts[k].goes_back = random.below(4) == 0;
        }
        if bench.receiver.wants_reset() {
            bench.store.reset();
            bench.receiver = Receiver::new(bench.receiver.identity, TICKS_PER_S);
        }
    }
    assert_eq!(bench.store.writes, seen.stored.iter().sum::<u32>());
    std::println!("RESULT update_fuzz_key={} {seen:?}", key.is_some());
    seen
}

#[test]
fn of_a_million_frames_only_whole_transfers_with_the_key_are_stored() {
    let seen = fuzz(Some(KEY));
    assert!(seen.opened.iter().all(|n| *n > 200), "{seen:?}");
    assert!(seen.refused.iter().all(|n| *n > 100), "{seen:?}");
    assert!(seen.stored[0] > 200 && seen.back[0] > 50, "{seen:?}");
    assert_eq!((seen.stored[1], seen.back[1]), (0, 0));
}

#[test]
fn of_a_million_frames_to_an_open_node_only_whole_sound_blobs_are_stored() {
    let seen = fuzz(None);
    assert!(seen.refused.iter().all(|n| *n > 50), "{seen:?}");
    assert!(seen.stored.iter().all(|n| *n > 200), "{seen:?}");
    assert!(seen.back.iter().all(|n| *n > 50), "{seen:?}");
}
