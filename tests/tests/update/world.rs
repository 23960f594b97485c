//! The bus, the node on it, and hosts.

use super::{OLD, SERIAL};
use firmware::store::Sector;
use firmware::store::flash_model::FlashModel;
use hal_adapters::can::BusFrame;
use hal_adapters::can::command::{Answer, Mailbox, Told};
use hal_adapters::can::update::Key;
use hal_adapters::fault::{Fault, Random};
use host_fit::bus::update::{Dialog, Job, Plan, UpdateError, Updated, Updater};
use std::collections::VecDeque;
use tests::node::{Node, TAKEN_PER_TICK};

/// The longest frame at 1 Mbit/s, us.
pub const SLOT_US: u64 = 135;
const TICK_US: u64 = 2_000;
/// A node is deaf for so long after a reset, us.
const START_US: u64 = 500_000;

/// Frames under way, some lost, repeated, delayed or damaged.
pub struct Channel {
    random: Random,
    per_million: [u64; 9],
    under_way: Vec<(u64, BusFrame)>,
}

impl Channel {
    pub fn new(faults: &[(Fault, u64)], seed: u64) -> Self {
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

    pub fn send(&mut self, now_us: u64, frame: BusFrame) {
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

/// Flash of which a probe has written the first slot.
pub fn flashed(blob: &[u8]) -> FlashModel {
    let mut flash = FlashModel::erased();
    flash.load(Sector::First, blob);
    flash
}

pub struct World {
    pub node: Node,
    fifo: VecDeque<BusFrame>,
    deaf_until_us: u64,
    pub to_node: Channel,
    to_hosts: Channel,
    pub now_us: u64,
    /// Everything that the hosts sent.
    pub recording: Vec<BusFrame>,
    pub overruns: u32,
    /// The node is reset at these times.
    pub resets_us: Vec<u64>,
    /// What was in flash after each cut of the power.
    pub after_cuts: Vec<Vec<u8>>,
    /// Answers of the node that no host hears.
    pub loses: fn(&Answer) -> bool,
}

impl World {
    pub fn new(key: Option<Key>, faults: &[(Fault, u64)], seed: u64) -> Self {
        Self {
            node: Node::new(Some(SERIAL), key, flashed(OLD), seed),
            fifo: VecDeque::new(),
            deaf_until_us: 0,
            to_node: Channel::new(faults, seed ^ 0x5555),
            to_hosts: Channel::new(faults, seed ^ 0xaaaa),
            now_us: 0,
            recording: Vec::new(),
            overruns: 0,
            resets_us: Vec::new(),
            after_cuts: Vec::new(),
            loses: |_| false,
        }
    }

    /// The time from one slot to the next: the node's frames and ticks; what reaches the hosts.
    pub fn slot(&mut self) -> Vec<BusFrame> {
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
            let frame = BusFrame::from(coded);
            let is_lost = match Mailbox::default().take(&frame) {
                Some(Ok(Told::Answer(answer))) => (self.loses)(&answer),
                _ => false,
            };
            if !is_lost {
                self.to_hosts.send(self.now_us, frame);
            }
        }
        self.to_hosts.arrived(self.now_us)
    }

    /// The program faults, and is deaf until its next start.
    pub fn fault(&mut self) {
        self.node.fault();
        self.fifo.clear();
        self.deaf_until_us = self.now_us + START_US;
    }

    /// Runs dialogs to their ends; two hosts hear each other.
    pub fn run<J: Job>(&mut self, hosts: &mut [Dialog<J>]) {
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

    pub fn update(&mut self, plan: Plan) -> Result<Updated, UpdateError> {
        let mut hosts = [Dialog::new(Updater::new(plan), 1)];
        self.run(&mut hosts);
        let [host] = hosts;
        host.into_job().result()
    }

    pub fn newest(&self) -> &[u8] {
        self.node.newest().expect("there is one")
    }
}
