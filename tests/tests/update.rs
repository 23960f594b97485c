//! A host and a node on one bus, in memory: the host's own dialog against the firmware's own
//! node, with a lossy bus, two hosts, resets, and a recording played again.

use firmware::store::Sector;
use firmware::store::flash_model::{Cut, FlashModel};
use hal_adapters::can::BusFrame;
use hal_adapters::can::command::{Command, Mailbox, Request, Told};
use hal_adapters::can::update::{Key, UpdateData, UpdateRequest};
use hal_adapters::fault::{Fault, Random};
use host_fit::bus::update::{
    BlobReader, Dialog, Identifier, Job, Plan, UpdateError, Updated, Updater,
};
use runtime::ParameterSet;
use runtime::blob::MAX_BYTES;
use std::collections::VecDeque;
use tests::node::{Node, TAKEN_PER_TICK};

const OLD: &[u8] = include_bytes!("../../runtime/examples/stage.bin");
const NEW: &[u8] = include_bytes!("../../runtime/examples/field.bin");
const SERIAL: &str = "HS-0007";
const KEY: Key = *b"a key for a test";

/// The longest frame at 1 Mbit/s, us.
const SLOT_US: u64 = 135;
const TICK_US: u64 = 2_000;
/// A node is deaf for so long after a reset, us.
const START_US: u64 = 500_000;

/// Frames under way, some lost, repeated, delayed or damaged.
struct Channel {
    random: Random,
    per_million: [u64; 9],
    under_way: Vec<(u64, BusFrame)>,
}

impl Channel {
    fn new(faults: &[(Fault, u64)], seed: u64) -> Self {
        let mut per_million = [0; 9];
        faults
            .iter()
            .for_each(|(fault, rate)| per_million[*fault as usize] = *rate);
        Self {
            random: Random::new(seed),
            per_million,
            under_way: Vec::new(),
        }
    }

    fn send(&mut self, now_us: u64, frame: BusFrame) {
        let mut below = self.random.below(1_000_000);
        let mut fault = None;
        for (candidate, rate) in Fault::ALL.into_iter().zip(self.per_million) {
            if below < rate {
                fault = Some(candidate);
                break;
            }
            below -= rate;
        }
        let delay = self.random.below(9) * 1_000;
        let due_us = match fault {
            Some(Fault::Drop) => return,
            Some(Fault::Repeat) => {
                self.under_way.push((now_us, frame));
                now_us + 500
            }
            Some(Fault::Swap) => now_us + 1_500,
            Some(Fault::Delay) => now_us + 2_000 + delay,
            _ => now_us,
        };
        let frame = fault.map_or(frame, |fault| frame.damaged(fault, &mut self.random));
        self.under_way.push((due_us, frame));
    }

    fn arrived(&mut self, now_us: u64) -> Vec<BusFrame> {
        let due = self
            .under_way
            .extract_if(.., |(due_us, _)| *due_us <= now_us);
        due.map(|(_, frame)| frame).collect()
    }
}

/// A controller that a probe has given this blob.
fn node(serial: &'static str, key: Option<Key>, blob: &[u8], seed: u64) -> Node {
    let mut flash = FlashModel::erased();
    flash.load(Sector::First, blob);
    Node::new(serial, key, flash, seed)
}

struct World {
    node: Node,
    fifo: VecDeque<BusFrame>,
    deaf_until_us: u64,
    to_node: Channel,
    to_hosts: Channel,
    now_us: u64,
    /// Everything that the hosts sent.
    recording: Vec<BusFrame>,
    overruns: u32,
    /// The node is reset at these times.
    resets_us: Vec<u64>,
    /// What was in flash after each cut of the power.
    after_cuts: Vec<Vec<u8>>,
}

impl World {
    fn new(key: Option<Key>, faults: &[(Fault, u64)], seed: u64) -> Self {
        Self {
            node: node(SERIAL, key, OLD, seed),
            fifo: VecDeque::new(),
            deaf_until_us: 0,
            to_node: Channel::new(faults, seed ^ 0x5555),
            to_hosts: Channel::new(faults, seed ^ 0xaaaa),
            now_us: 0,
            recording: Vec::new(),
            overruns: 0,
            resets_us: Vec::new(),
            after_cuts: Vec::new(),
        }
    }

    /// The time from one slot to the next: the node's frames and ticks; what reaches the hosts.
    fn slot(&mut self) -> Vec<BusFrame> {
        let tick_before = self.now_us / TICK_US;
        self.now_us += SLOT_US;
        let is_deaf = self.now_us < self.deaf_until_us;
        for frame in self.to_node.arrived(self.now_us) {
            if !is_deaf && self.fifo.len() < TAKEN_PER_TICK {
                self.fifo.push_back(frame);
            } else {
                self.overruns += u32::from(!is_deaf);
            }
        }
        if self.now_us / TICK_US > tick_before && !is_deaf {
            self.node.tick(0, self.fifo.drain(..));
        }
        let is_due = self.resets_us.first().is_some_and(|at| *at <= self.now_us);
        let is_off = self.node.flash().is_off();
        if is_due || is_off || self.node.is_to_be_reset() {
            if is_due {
                self.resets_us.remove(0);
            }
            if is_off {
                self.node.power_cycle();
                self.after_cuts.push(self.newest().to_vec());
            } else {
                self.node.reset();
            }
            self.fifo.clear();
            self.deaf_until_us = self.now_us + START_US;
        }
        if !is_deaf && let Some(coded) = self.node.send() {
            self.to_hosts.send(self.now_us, BusFrame::from(coded));
        }
        self.to_hosts.arrived(self.now_us)
    }

    /// Runs dialogs to their ends; two hosts hear each other.
    fn run<J: Job>(&mut self, hosts: &mut [Dialog<J>]) {
        let until_us = self.now_us + 120_000_000;
        while hosts.iter().any(|host| !host.is_over()) {
            assert!(self.now_us < until_us, "it does not end");
            for frame in self.slot() {
                let now_us = self.now_us;
                hosts.iter_mut().for_each(|host| host.take(&frame, now_us));
            }
            for k in 0..hosts.len() {
                let Some(coded) = hosts[k].poll(self.now_us) else {
                    continue;
                };
                let frame = BusFrame::from(coded);
                self.recording.push(frame);
                self.to_node.send(self.now_us, frame);
                for (other, host) in hosts.iter_mut().enumerate() {
                    if other != k {
                        host.take(&frame, self.now_us);
                    }
                }
            }
        }
    }

    fn update(&mut self, plan: Plan) -> Result<Updated, UpdateError> {
        let mut hosts = [Dialog::new(Updater::new(plan), 1)];
        self.run(&mut hosts);
        let [host] = hosts;
        host.into_job().result()
    }

    fn newest(&self) -> &[u8] {
        self.node.newest().expect("there is one")
    }
}

fn command(host: &mut Mailbox, request: Request, token: u8) -> BusFrame {
    let told = Told::Command(Command::new(request, token));
    BusFrame::from(host.send(&told).expect("a known message"))
}

fn plan(blob: &[u8]) -> Plan {
    Plan {
        blob: blob.to_vec(),
        serial: Some(SERIAL.to_owned()),
        key: Some(KEY),
        declares_servo_off: true,
        activates: false,
        token: 9,
    }
}

/// The largest blob that a fit writes for this stage: the field model, with a full time.
fn largest_of(serial: &str) -> Vec<u8> {
    let mut set = ParameterSet::from_bytes(NEW).expect("a sound example");
    set.serial = serial.try_into().expect("32 bytes");
    set.created = "2026-11-22T10:00:00.000000+00:00"
        .try_into()
        .expect("32 bytes");
    let mut buffer = [0; MAX_BYTES];
    set.to_bytes(&mut buffer).expect("it fits").to_vec()
}

#[test]
fn the_largest_blob_takes_less_than_a_second_on_a_loaded_bus() {
    let blob = largest_of(&"S".repeat(32));
    for key in [None, Some(KEY)] {
        let serial: &'static str = "S".repeat(32).leak();
        let mut world = World::new(key, &[], 1);
        world.node = node(serial, key, &blob, 1);
        world.to_node.send(
            0,
            command(&mut Mailbox::default(), Request::Record { on: true }, 3),
        );
        let mut newer = ParameterSet::from_bytes(&blob).expect("sound");
        newer.fit.rows += 1;
        let mut buffer = [0; MAX_BYTES];
        let newer = newer.to_bytes(&mut buffer).expect("it fits");
        let job = Plan {
            serial: Some(serial.to_owned()),
            ..plan(newer)
        };
        let updated = world.update(job).expect("it is taken");
        assert_eq!(updated.sequence, Some(1));
        assert_eq!(updated.repeated, (0, 0));
        assert_eq!(world.newest(), newer);
        println!(
            "RESULT update_bytes={} key={} update_us={} frames={} overruns={}",
            newer.len(),
            key.is_some(),
            world.now_us,
            world.recording.len(),
            world.overruns
        );
        assert!(world.now_us <= 1_000_000);
        assert_eq!(world.overruns, 0);
    }
}

#[test]
fn on_a_bad_bus_the_update_ends_with_the_blob_bit_for_bit_or_a_refusal() {
    for (rate, least) in [(50_000, 108), (400_000, 108), (950_000, 0)] {
        let ends = on_a_bad_bus(rate);
        println!(
            "RESULT bad_bus_per_million={rate} updated={} refused={}",
            ends[0], ends[1]
        );
        assert!(ends[0] >= least, "{ends:?}");
    }
}

/// Twelve updates for each fault, at so many per million frames: how many were stored and refused.
fn on_a_bad_bus(rate: u64) -> [u32; 2] {
    let mut ends = [0; 2];
    for fault in Fault::ALL {
        for seed in 0..12 {
            let mut world = World::new(Some(KEY), &[(fault, rate)], seed);
            match world.update(plan(NEW)) {
                Ok(updated) => {
                    assert_eq!(world.newest(), NEW, "{fault:?} {seed}");
                    assert_eq!(updated.sequence, Some(1), "{fault:?} {seed}");
                    ends[0] += 1;
                }
                Err(error) => {
                    println!("{fault:?} {seed}: {error}");
                    let newest = world.newest();
                    assert!(newest == NEW || newest == OLD, "{fault:?} {seed}");
                    ends[1] += 1;
                }
            }
        }
    }
    ends
}

#[test]
fn of_two_hosts_at_once_one_wins_or_both_in_turn() {
    let other = {
        let mut set = ParameterSet::from_bytes(OLD).expect("sound");
        set.fit.rows += 1;
        let mut buffer = [0; MAX_BYTES];
        set.to_bytes(&mut buffer).expect("it fits").to_vec()
    };
    // The same tokens are the worst case.
    for (token, seed) in [(9, 1), (9, 2), (77, 3), (78, 4), (79, 5)] {
        let mut world = World::new(Some(KEY), &[(Fault::Drop, 10_000)], seed);
        let second = Plan {
            token,
            ..plan(&other)
        };
        let plans = [plan(NEW), second];
        let mut first = 1;
        let mut hosts = plans.map(|plan| {
            let dialog = Dialog::new(Updater::new(plan), first);
            first += if token == 9 { 0 } else { 50 };
            dialog
        });
        world.run(&mut hosts);
        let results = hosts.map(|host| host.into_job().result());
        println!(
            "{token}: {:?}",
            results.each_ref().map(|r| r.as_ref().map(|u| u.sequence))
        );
        let stored: Vec<_> = results
            .iter()
            .flatten()
            .filter_map(|u| u.sequence)
            .collect();
        assert!(token == 9 || !stored.is_empty(), "{results:?}");
        let newest = world.newest();
        assert!(newest == NEW || newest == other || stored.is_empty());
        assert_eq!(world.node.records() as usize, stored.len());
        assert!(stored.len() < 2 || stored[0] != stored[1], "{stored:?}");
    }
}

#[test]
fn a_host_that_finds_another_at_it_gives_up_and_does_not_end_its_transfer() {
    let mut world = World::new(None, &[], 1);
    let mut other = Mailbox::default();
    let off = command(&mut other, Request::ServoOff { seconds: 255 }, 3);
    let begin = Request::Update(UpdateRequest::Begin { bytes: 500 });
    let begin = command(&mut other, begin, 200);
    world.to_node.send(0, off);
    world.to_node.send(0, begin);
    let mut host = Dialog::new(Updater::new(plan(NEW)), 1);
    let mut next_us = 0;
    while !host.is_over() {
        for frame in world.slot() {
            host.take(&frame, world.now_us);
        }
        let polled = host.poll(world.now_us);
        if let Some(coded) = polled {
            world.to_node.send(world.now_us, BusFrame::from(coded));
        } else if world.now_us >= next_us {
            next_us = world.now_us + 1_000_000;
            let (token, index, word) = (200, 1, 2);
            let data = Told::UpdateData(UpdateData { token, index, word });
            let data = BusFrame::from(other.send(&data).expect("a known message"));
            world.to_node.send(world.now_us, data);
        }
    }
    assert_eq!(host.into_job().result(), Err(UpdateError::Busy));
    assert!(world.node.is_updating());
    assert_eq!(world.node.records(), 0);
}

#[test]
fn a_reset_at_any_moment_leaves_the_old_or_the_new_and_the_update_goes_on() {
    for at_ms in (0..450).step_by(7) {
        let mut world = World::new(Some(KEY), &[], 5);
        world.resets_us = vec![at_ms * 1_000];
        let result = world.update(plan(NEW));
        assert!(result.is_ok(), "{at_ms}: {result:?}");
        assert_eq!(world.newest(), NEW, "{at_ms}");
        assert_eq!(world.node.records(), 1, "{at_ms}");
    }
}

#[test]
fn a_cut_of_the_power_in_any_operation_leaves_the_old_or_the_new_and_the_update_goes_on() {
    let mut whole = World::new(Some(KEY), &[], 5);
    let in_the_start = whole.node.flash().operations;
    assert!(whole.update(plan(NEW)).is_ok());
    let operations = whole.node.flash().operations;
    let (mut old, mut new) = (0, 0);
    for (at, cut) in (0..operations).flat_map(|at| Cut::ALL.map(|cut| (at, cut))) {
        // Of odd seeds, what was cut reads anew after each start.
        let seed = at as u64;
        let mut flash = FlashModel::erased();
        flash.load(Sector::First, OLD);
        flash.seed(seed);
        flash.cut_at(at, cut);
        let mut world = World::new(Some(KEY), &[], seed);
        world.node = Node::new(SERIAL, Some(KEY), flash, seed);
        let result = world.update(plan(NEW));
        assert!(result.is_ok(), "{at} {cut:?}: {result:?}");
        assert_eq!(world.newest(), NEW, "{at} {cut:?}");
        match &world.after_cuts[..] {
            [blob] if blob == OLD => old += 1,
            [blob] if blob == NEW => new += 1,
            _ => panic!("{at} {cut:?} left something else"),
        }
    }
    println!(
        "RESULT update_cuts={} in_the_start={} old={old} new={new}",
        old + new,
        3 * in_the_start
    );
    assert!(old > 3 * in_the_start && new > 0);
}

#[test]
fn activated_parameters_run_are_told_and_read_back() {
    let mut world = World::new(Some(KEY), &[(Fault::Drop, 20_000)], 8);
    let updated = world.update(Plan {
        activates: true,
        ..plan(NEW)
    });
    let updated = updated.expect("it is taken");
    assert!(updated.is_active && world.node.resets() == 1);
    let before = updated.before.running.expect("it ran");
    assert!(before.are(OLD) && before.sequence == 0);
    let mut hosts = [Dialog::new(BlobReader::default(), 30)];
    world.run(&mut hosts);
    let [host] = hosts;
    let (identity, blob) = host.into_job().result().expect("it runs");
    assert_eq!(blob, NEW);
    let (set, running) = (ParameterSet::from_bytes(NEW), identity.running);
    let (set, running) = (set.expect("sound"), running.expect("it runs"));
    assert_eq!(
        (identity.serial.as_str(), identity.needs_key),
        (SERIAL, true)
    );
    assert_eq!((running.sequence, identity.newest_sequence), (1, 1));
    assert_eq!((running.rms, running.peak), (set.fit.rms, set.fit.peak));
    assert_eq!(running.created, set.created.as_str());
    assert_eq!(identity.program_version, [1, 2, 3]);
    // The same again is not sent, and the record before comes back on demand.
    let again = Plan {
        key: None,
        declares_servo_off: false,
        ..plan(NEW)
    };
    let again = world.update(again).expect("nothing to do");
    assert_eq!((again.sequence, again.is_active), (None, true));
    let back = world.update(Plan {
        activates: true,
        ..plan(&[])
    });
    assert_eq!(back.expect("there is one").sequence, Some(2));
    assert_eq!(world.newest(), OLD);
    let mut hosts = [Dialog::new(Identifier::default(), 60)];
    world.run(&mut hosts);
    let [host] = hosts;
    let running = host.into_job().result().expect("it answers").running;
    assert!(running.is_some_and(|running| running.are(OLD) && running.sequence == 2));
}

#[test]
fn what_is_refused_is_refused_by_its_reason_and_nothing_is_written() {
    let other_stage = ParameterSet {
        serial: "HS-0008".try_into().expect("short"),
        ..ParameterSet::from_bytes(NEW).expect("sound")
    };
    let mut buffer = [0; MAX_BYTES];
    let other_stage = other_stage.to_bytes(&mut buffer).expect("it fits");
    let on = Plan {
        declares_servo_off: false,
        ..plan(NEW)
    };
    let no_key = Plan {
        key: None,
        ..plan(NEW)
    };
    let wrong_key = Plan {
        key: Some([0; 16]),
        ..plan(NEW)
    };
    let asked = Plan {
        serial: Some("HS-0008".to_owned()),
        ..plan(NEW)
    };
    let unnamed = Plan {
        serial: None,
        ..plan(other_stage)
    };
    let (expected, found) = ("HS-0008".to_owned(), SERIAL.to_owned());
    for (plan, want) in [
        (on, UpdateError::ServoOn { declared: false }),
        (no_key, UpdateError::KeyNeeded),
        (wrong_key, UpdateError::NotAuthorised),
        (asked, UpdateError::OtherStage { expected, found }),
        (unnamed, UpdateError::BadContent { kind: 10 }),
        (plan(&[]), UpdateError::NoPrevious),
    ] {
        let mut world = World::new(Some(KEY), &[], 3);
        assert_eq!(world.update(plan), Err(want));
        assert_eq!(world.node.records(), 0);
    }
    // Nobody is there.
    let mut world = World::new(None, &[(Fault::Drop, 1_000_000)], 3);
    assert_eq!(world.update(plan(NEW)), Err(UpdateError::NoAnswer));
}

#[test]
fn an_interrupted_update_closes_its_transfer() {
    for after in [10, 60, 100, 180] {
        let mut world = World::new(Some(KEY), &[], 3);
        let mut host = Dialog::new(Updater::new(plan(NEW)), 1);
        let mut frames = 0;
        while frames < after {
            for frame in world.slot() {
                host.take(&frame, world.now_us);
            }
            if let Some(coded) = host.poll(world.now_us) {
                world.to_node.send(world.now_us, BusFrame::from(coded));
                frames += 1;
            }
        }
        host.interrupt();
        let mut hosts = [host];
        world.run(&mut hosts);
        let [host] = hosts;
        assert_eq!(host.into_job().result(), Err(UpdateError::Interrupted));
        assert_eq!(world.node.records(), 0);
        // Another may begin at once, and the servo is on again.
        let on = Plan {
            declares_servo_off: false,
            token: 50,
            ..plan(NEW)
        };
        assert_eq!(
            world.update(on),
            Err(UpdateError::ServoOn { declared: false })
        );
        let at_us = world.now_us;
        assert!(world.update(plan(NEW)).is_ok());
        assert!(world.now_us - at_us < 1_000_000);
    }
}

#[test]
fn a_recording_of_a_good_update_stores_nothing_when_it_is_played_again() {
    for key in [Some(KEY), None] {
        for pause_ms in [0, 10_000] {
            let mut world = World::new(key, &[], 21);
            world.update(plan(NEW)).expect("it is taken");
            let recording = world.recording.clone();
            assert!(recording.len() > 180);
            (0..pause_ms * 1_000 / SLOT_US).for_each(|_| drop(world.slot()));
            let mut frames = recording.iter().copied();
            let mut next_us = world.now_us;
            loop {
                if world.now_us >= next_us {
                    next_us = world.now_us + 1_000;
                    match frames.next() {
                        Some(frame) => world.to_node.send(world.now_us, frame),
                        None => break,
                    }
                }
                world.slot();
            }
            (0..10_000).for_each(|_| drop(world.slot()));
            assert_eq!(world.node.records(), 1);
            assert_eq!(world.newest(), NEW);
        }
    }
}
