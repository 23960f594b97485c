//! Frames into a node that takes new parameters: only a whole blob that was sent is ever stored,
//! and without the key none.

#![no_main]

use embedded_can::Frame;
use fuzz::PARAMS;
use fuzz::bus::Numbers;
use hal_adapters::can::command::{Command, Request};
use hal_adapters::can::e2e::Payload;
use hal_adapters::can::update::{UpdateData, UpdateRequest, word_at};
use hal_adapters::can::{BusFrame, Message};
use libfuzzer_sys::fuzz_target;
use runtime::ParameterSet;
use runtime::blob::MAX_BYTES;
use runtime::parameters::Text;
use std::sync::LazyLock;
use tests::flash_model::FlashModel;
use tests::node::{Node, TAKEN_PER_TICK};

/// What is sent: other parameters of the same stage.
static NEW: LazyLock<Vec<u8>> = LazyLock::new(|| {
    let mut set = ParameterSet::from_bytes(PARAMS).expect("the blob of the examples");
    set.created = Text::try_from("later").expect("short");
    let mut buffer = [0; MAX_BYTES];
    set.to_bytes(&mut buffer).expect("room enough").to_vec()
});

/// A node, and how the frames to it are numbered.
struct Bench {
    node: Node,
    numbers: Numbers,
    /// Frames that the next tick takes.
    waiting: Vec<BusFrame>,
}

impl Bench {
    fn take(&mut self, message: Message, payload: Payload) {
        let frame = self.numbers.frame(message, payload);
        self.receive(frame);
    }

    fn receive(&mut self, frame: BusFrame) {
        self.waiting.push(frame);
        if self.waiting.len() == TAKEN_PER_TICK {
            self.tick();
        }
    }

    fn tick(&mut self) {
        self.node.tick(0, self.waiting.drain(..));
        while self.node.send().is_some() {}
    }

    fn ask(&mut self, request: Request, token: u8) {
        self.take(Message::Command, Command::new(request, token).payload());
    }

    fn step(&mut self, [kind, a, b]: [u8; 3]) {
        // Two tokens, two numbers: what no one sends belongs to the target `node`.
        let (token, sequence) = (b & 1, u32::from(a & 3));
        let ask = |request| Request::Update(request);
        match kind % 16 {
            0 => self.ask(Request::ServoOff { seconds: a }, token),
            1 => {
                let bytes = NEW.len() as u16;
                self.ask(ask(UpdateRequest::Begin { bytes }), token);
            }
            2 => (a..=a.saturating_add(b)).for_each(|index| {
                let word = word_at(&NEW, index.into()).unwrap_or_default();
                let data = UpdateData {
                    token: 0,
                    index,
                    word,
                };
                self.take(Message::UpdateData, data.payload());
            }),
            3 => {
                let data = UpdateData {
                    token,
                    index: a,
                    word: u32::from(b),
                };
                self.take(Message::UpdateData, data.payload());
            }
            4 | 5 => self.ask(ask(UpdateRequest::Commit { sequence }), token),
            6 => self.ask(ask(UpdateRequest::Abort), token),
            7 => self.ask(ask(UpdateRequest::Activate), token),
            8 => self.ask(ask(UpdateRequest::Challenge { part: a }), token),
            9 => self.ask(ask(UpdateRequest::ReadBack { index: a }), token),
            10 => self.ask(ask(UpdateRequest::Tell { page: a }), token),
            11 => self.ask(
                ask(UpdateRequest::Begin {
                    bytes: u16::from_le_bytes([a, b]),
                }),
                0,
            ),
            12 => {
                let frame = BusFrame::new(Message::Command.id(), &[kind, a, b, 0, a, b, 0, kind]);
                self.receive(frame.expect("eight bytes"));
            }
            13 => self.node.reset(),
            _ => (0..a).for_each(|_| self.tick()),
        }
        self.tick();
        if self.node.is_to_be_reset() {
            self.node.reset();
        }
    }
}

fuzz_target!(|data: &[u8]| {
    let Some((&form, data)) = data.split_first() else {
        return;
    };
    let key = (form & 1 == 1).then_some([7; 16]);
    let mut flash = FlashModel::erased();
    flash.load(0, PARAMS);
    let mut bench = Bench {
        node: Node::new(Some("HS-0007"), key, flash, u64::from(form)),
        numbers: Numbers::default(),
        waiting: Vec::new(),
    };
    let mut records = 0;
    for step in data.as_chunks().0 {
        bench.step(*step);
        let now = bench.node.records();
        assert!(now == records || now == records + 1);
        assert!(key.is_none() || now == 0, "stored without the key");
        if now != records {
            records = now;
            let blob = bench.node.newest();
            assert!(blob.is_some_and(|blob| blob == *NEW));
        }
    }
    assert!(bench.node.newest().is_some());
});
