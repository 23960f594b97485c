//! The bus, the node on it, and hosts.

use super::{OLD, SERIAL};
use hal_adapters::can::BusFrame;
use hal_adapters::can::command::{Answer, Command, Content, Mailbox, Request};
use hal_adapters::can::update::Key;
use host_fit::bus::update::{Identity, Link, Talk, UpdateError, UpdateSettings, Updated, on};
use std::collections::VecDeque;
use tests::fault::{Channel, Fault};
use tests::flash_model::FlashModel;
use tests::node::{Node, TAKEN_PER_TICK};

/// The longest frame at 1 Mbit/s, us.
const SLOT_US: u64 = 135;
const TICK_US: u64 = 2_000;
/// A node is deaf for so long after a reset, us.
const START_US: u64 = 200_000;
/// It is deaf while it erases a sector, too, us.
const ERASE_US: u64 = 500_000;

/// Flash with this blob in its first slot, as a probe writes it.
pub fn flashed(blob: &[u8]) -> FlashModel {
    let mut flash = FlashModel::erased();
    flash.load(0, blob);
    flash
}

pub struct World {
    pub node: Node,
    fifo: VecDeque<BusFrame>,
    deaf_until_us: u64,
    pub to_node: Channel,
    to_hosts: Channel,
    pub now_us: u64,
    /// The frames of the host, and when it sent them.
    pub recording: Vec<(u64, BusFrame)>,
    /// The frames of another host, in the order of time.
    others: VecDeque<(u64, BusFrame)>,
    /// Another host declares the servo on as soon as a blob was stored and the node hears again.
    pub declares_on_once_stored: bool,
    /// The user stops the script at this frame of the host.
    pub interrupt_at: Option<usize>,
    token: u8,
    /// Frames that the host has not received yet.
    heard: VecDeque<BusFrame>,
    /// Answers of the node that no host hears.
    pub loses: fn(&Answer) -> bool,
}

impl World {
    pub fn new(key: Option<&'static Key>, faults: &[(Fault, u64)], seed: u64) -> Self {
        Self {
            node: Node::new(Some(SERIAL), key, flashed(OLD), seed),
            fifo: VecDeque::new(),
            deaf_until_us: 0,
            to_node: Channel::new(faults, seed ^ 0x5555),
            to_hosts: Channel::new(faults, seed ^ 0xaaaa),
            now_us: 0,
            recording: Vec::new(),
            others: VecDeque::new(),
            declares_on_once_stored: false,
            interrupt_at: None,
            token: 8,
            heard: VecDeque::new(),
            loses: |_| false,
        }
    }

    /// One slot: the frames and the tick of the node; gives the frames that reach the hosts.
    pub fn slot(&mut self) -> Vec<BusFrame> {
        let tick_before = self.now_us / TICK_US;
        self.now_us += SLOT_US;
        let is_deaf = self.now_us < self.deaf_until_us;
        for frame in self.to_node.arrived(self.now_us) {
            if !is_deaf && self.fifo.len() < TAKEN_PER_TICK {
                self.fifo.push_back(frame);
            }
        }
        if self.now_us / TICK_US > tick_before && !is_deaf && self.node.tick(0, self.fifo.drain(..))
        {
            self.deaf_until_us = self.now_us + ERASE_US;
        }
        if self.node.records() > 0 && core::mem::take(&mut self.declares_on_once_stored) {
            let on = command(Request::ServoOff { seconds: 0 }, 4, 1);
            self.others.push_back((self.deaf_until_us, on));
        }
        while let Some((_, frame)) = self.others.pop_front_if(|(at, _)| *at <= self.now_us) {
            self.to_node.send(self.now_us, frame);
            self.heard.push_back(frame);
        }
        if self.node.is_to_be_reset() {
            self.node.reset(START_US as u32);
            self.fifo.clear();
            self.deaf_until_us = self.now_us + START_US;
        }
        if !is_deaf && let Some(coded) = self.node.send() {
            let frame = BusFrame::from(coded);
            let is_lost = match Mailbox::default().take(&frame) {
                Some(Ok(Content::Answer(answer))) => (self.loses)(&answer),
                _ => false,
            };
            if !is_lost {
                self.to_hosts.send(self.now_us, frame);
            }
        }
        self.to_hosts.arrived(self.now_us)
    }

    /// Sends a request of another host after so long.
    pub fn other_asks(&mut self, after_us: u64, request: Request, token: u8) {
        let frame = command(request, token, self.others.len());
        self.others.push_back((self.now_us + after_us, frame));
    }

    /// A host that asks one thing after the other.
    pub fn talk(&mut self) -> Talk<&mut Self> {
        self.token = self.token.wrapping_add(40);
        let token = self.token;
        Talk::new(self, token)
    }

    pub fn update(&mut self, plan: &UpdateSettings) -> Result<Updated, UpdateError> {
        on::update(&mut self.talk(), plan, &mut |_, _| {})
    }

    pub fn identify(&mut self) -> Identity {
        on::identify(&mut self.talk()).expect("it answers")
    }

    pub fn newest(&mut self) -> Vec<u8> {
        self.node.newest().expect("there is one")
    }
}

/// A frame with a request and the counter of another host.
fn command(request: Request, token: u8, counter: usize) -> BusFrame {
    let mut mailbox = Mailbox::default();
    let content = Content::Command(Command::new(request, token));
    let frames = (0..=counter).map(|_| mailbox.send(&content));
    BusFrame::from(frames.last().flatten().expect("a known message"))
}

impl Link for &mut World {
    fn send(&mut self, frame: BusFrame) -> Result<(), UpdateError> {
        let now_us = self.now_us;
        self.recording.push((now_us, frame));
        self.to_node.send(now_us, frame);
        Ok(())
    }

    fn receive(&mut self, until_us: u64) -> Result<Option<BusFrame>, UpdateError> {
        assert!(self.now_us < 300_000_000, "it does not end");
        while self.heard.is_empty() && self.now_us < until_us {
            let heard = self.slot();
            self.heard.extend(heard);
        }
        Ok(self.heard.pop_front())
    }

    fn now_us(&self) -> u64 {
        self.now_us
    }

    fn is_interrupted(&self) -> bool {
        self.interrupt_at
            .is_some_and(|at| self.recording.len() >= at)
    }
}
