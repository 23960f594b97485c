//! The start of every check: images, blobs, the log and the poses that the host decodes from it. And the
//! content of the frames on the bus.

use crate::adc_model::{Input, Row};
use crate::can_model::Sent;
use crate::image::Image;
use crate::machine::Machine;
use embedded_can::Frame;
use hal_adapters::can::command::{Answer, Command, Outcome, Request};
use hal_adapters::can::e2e::{protect, unprotect};
use hal_adapters::can::pose::status_to_bus;
use hal_adapters::can::sensor::read_temperature_mc;
use hal_adapters::can::status::{HealthPage, NodeState, NodeStatus};
use hal_adapters::can::{BusFrame, Layout, Message, NodeNumber};
use runtime::{AnyDecoder, Decode, PlanarPose, RawFrame, Status};
use std::ffi::OsString;
use std::path::Path;

/// Bits of the six words of a pose, X, Y, Rz, Z, Rx, Ry, and its status.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Words {
    /// The six words.
    pub words: [u32; 6],
    /// The status.
    pub status: u32,
}

impl Words {
    /// The host's words of a row of the log.
    pub fn decoded(decoder: &AnyDecoder, row: Row, temperature_mc: [i32; 2]) -> Self {
        let [a, b, c, g1, g2, g3] = row;
        let frame = RawFrame::new([a, b, c], [g1, g2, g3], 0, 0);
        let frame = frame.with_temperature_mc(temperature_mc);
        let reading = decoder.decode(&frame, &PlanarPose::ZERO);
        let [x, y, rz] = reading.pose.planar.to_array();
        let [z, rx, ry] = reading.pose.vertical.to_array();
        Self {
            words: [x, y, rz, z, rx, ry].map(f32::to_bits),
            status: status_to_bus(reading.status),
        }
    }
}

/// Number of a second stage on the bus.
pub const NEIGHBOUR: u32 = 5;
/// Its servo period, us.
pub const NEIGHBOUR_PERIOD_US: u64 = 1000;

/// The files that the script prepared.
pub struct Bench {
    /// The emulator's library.
    pub library: OsString,
    /// The program with a key.
    pub image: Image,
    /// The program without a key, as [`NEIGHBOUR`] with a servo period of [`NEIGHBOUR_PERIOD_US`].
    neighbour: Image,
    /// The blob of the log, of serial `stage-7`.
    pub blob: Vec<u8>,
    /// The same calibration, made later.
    pub later: Vec<u8>,
    /// A blob of another stage.
    pub other: Vec<u8>,
    /// The codes of the log.
    pub rows: Vec<Row>,
    /// The poses that `host-fit decode` gives.
    pub poses: Vec<Words>,
}

impl Bench {
    /// Reads the files in `folder`.
    ///
    /// # Panics
    /// If a file is missing or wrong.
    pub fn read(folder: &Path, library: OsString) -> Self {
        let image = |name: &str| Image::read(&folder.join(name));
        let bytes = |name: &str| std::fs::read(folder.join(name)).expect(name);
        let text = |name: &str| String::from_utf8(bytes(name)).expect("text");
        let pose = |[status, words @ ..]: [f64; 7]| Words {
            words: words.map(|micro| ((micro * 1e-6) as f32).to_bits()),
            status: status as u32,
        };
        let pose_columns = [
            "status", "x_um", "y_um", "rz_urad", "z_um", "rx_urad", "ry_urad",
        ];
        Self {
            library,
            image: image("stage.elf"),
            neighbour: image("neighbour.elf"),
            blob: bytes("params.bin"),
            later: bytes("later.bin"),
            other: bytes("other.bin"),
            rows: rows(&text("log.csv")),
            poses: columns(&text("pose.csv"), pose_columns).map(pose).collect(),
        }
    }

    /// A controller with these parameter slots; its converter plays the log.
    pub fn machine(&self, slots: [&[u8]; 2]) -> Machine {
        self.machine_playing(slots, self.rows.clone())
    }

    /// A controller with the blob of the log after some ticks; the frames before are forgotten.
    pub fn running(&self, ticks: u64) -> Machine {
        let mut machine = self.machine([&self.blob, &[]]);
        machine.run_ticks(ticks);
        machine.chip.can.sent.clear();
        machine
    }

    /// A controller with a converter that plays these rows.
    pub fn machine_playing(&self, slots: [&[u8]; 2], rows: Vec<Row>) -> Machine {
        Machine::new(&self.library, &self.image, rows, slots)
    }

    /// The neighbour, with the blob of the log; its converter plays the log in its own period.
    pub fn neighbour(&self) -> Machine {
        let slots = [&self.blob[..], &[]];
        let mut machine = Machine::new(&self.library, &self.neighbour, vec![], slots);
        machine.chip.can.node = NodeNumber::new(NEIGHBOUR).expect("no number");
        machine.chip.adc.input = Input::held(self.rows.clone()).every(NEIGHBOUR_PERIOD_US);
        machine
    }

    /// The host's words of a tick. The log is played in a loop.
    pub fn pose(&self, tick: u64) -> Words {
        self.poses[tick as usize % self.poses.len()]
    }
}

/// Numbers in the columns of these names.
fn columns<const N: usize>(text: &str, names: [&str; N]) -> impl Iterator<Item = [f64; N]> {
    let mut lines = text.lines();
    let header: Vec<_> = lines.next().unwrap_or_default().split(',').collect();
    let at = names.map(|name| header.iter().position(|cell| *cell == name).expect(name));
    lines.map(move |line| {
        let cells: Vec<_> = line.split(',').collect();
        at.map(|at| cells[at].parse().expect("a number"))
    })
}

/// The codes of a log.
pub fn rows(text: &str) -> Vec<Row> {
    let (hall, caps) = (
        ["hall_a_cnt", "hall_b_cnt", "hall_c_cnt"],
        ["cap1_cnt", "cap2_cnt", "cap3_cnt"],
    );
    let ([a, b, c], [g1, g2, g3]) = (hall, caps);
    let row = |codes: [f64; 6]| codes.map(|code| code as i32);
    columns(text, [a, b, c, g1, g2, g3]).map(row).collect()
}

/// One axis of one tick on the bus.
#[derive(Clone, Copy, Debug)]
pub struct Axis {
    /// Periods since the first tick.
    pub tick: u64,
    /// Time from the start of that period to the mailbox, us.
    pub into_tick_us: u64,
    /// Axis, 0 to 5 for X, Y, Rz, Z, Rx, Ry.
    pub axis: usize,
    /// The word.
    pub word: u32,
    /// The status.
    pub status: u32,
}

impl Axis {
    /// Whether its status says valid.
    pub fn is_valid(&self) -> bool {
        let invalid = match self.axis {
            0..3 => Status::PLANAR_INVALID,
            _ => Status::VERTICAL_INVALID,
        };
        self.status & invalid.bits() == 0
    }

    /// Whether its word and status equal these.
    pub fn equals(&self, words: &Words) -> bool {
        (self.word, self.status) == (words.words[self.axis], words.status)
    }
}

/// Frames on the bus, by kind.
#[derive(Default)]
pub struct Seen {
    /// Poses.
    pub axes: Vec<Axis>,
    /// States.
    pub statuses: Vec<(u64, NodeStatus)>,
    /// Answers.
    pub answers: Vec<Answer>,
    /// Counters.
    pub health: Vec<HealthPage>,
    /// Number and time of ticks, us, by the controller.
    pub times: Vec<(u32, u32)>,
    /// Temperatures of mount and body, m degC, each from its tick on.
    pub temperatures: Vec<(u64, [i32; 2])>,
    /// Frames with codes.
    pub recorded: usize,
    /// Frames with a wrong check or a foreign identifier.
    pub damaged: usize,
}

const AXES: [Message; 6] = [
    Message::PoseX,
    Message::PoseY,
    Message::PoseRz,
    Message::PoseZ,
    Message::PoseRx,
    Message::PoseRy,
];

impl Seen {
    /// Takes the frames since the last look.
    pub fn since_last(machine: &mut Machine) -> Self {
        let first_ns = machine.chip.first_tick_ns.unwrap_or(0);
        let mut seen = Self::default();
        for sent in std::mem::take(&mut machine.chip.can.sent) {
            seen.take(&sent, first_ns);
        }
        seen
    }

    /// Runs some ticks, and takes the frames since the last look.
    pub fn after(machine: &mut Machine, ticks: u64) -> Self {
        machine.run_ticks(ticks);
        Self::since_last(machine)
    }

    /// Takes one frame.
    pub fn take(&mut self, sent: &Sent, first_ns: u64) {
        let since_ns = sent.asked_ns.saturating_sub(first_ns);
        let tick = since_ns / 2_000_000;
        let opened = Message::from_id(sent.frame.id).zip(sent.frame.data().first_chunk());
        let read = opened.and_then(|(m, bytes)| Some((m, unprotect(m.key(), bytes)?.1)));
        let Some((message, payload)) = read else {
            self.damaged += 1;
            return;
        };
        match message {
            Message::NodeStatus => self
                .statuses
                .push((tick, NodeStatus::from_payload(payload))),
            Message::Health => self.health.push(HealthPage::from_payload(payload)),
            Message::Answer => self.answers.push(Answer::from_payload(payload)),
            Message::PoseTime | Message::SensorTime => {
                self.times.push((payload.short, payload.long));
            }
            Message::Temperature => {
                self.temperatures.push((tick, read_temperature_mc(payload)));
            }
            _ if Layout::from_message(message).is_some() => self.recorded += 1,
            _ => match AXES.iter().position(|axis| *axis == message) {
                Some(axis) => self.axes.push(Axis {
                    tick,
                    into_tick_us: since_ns % 2_000_000 / 1000,
                    axis,
                    word: payload.long,
                    status: payload.short,
                }),
                None => self.damaged += 1,
            },
        }
    }

    /// The last state and its reason.
    pub fn last_state(&self) -> Option<(NodeState, u8)> {
        let status = self.last_status()?;
        Some((status.state?, status.reason))
    }

    /// The last flags.
    pub fn flags(&self) -> u8 {
        self.last_status().map_or(0, |status| status.flags)
    }

    /// The tick of the first state with all the flags.
    pub fn first_state(&self, flags: u8) -> Option<u64> {
        let mut states = self.statuses.iter();
        let first = states.find(|(_, status)| status.flags & flags == flags);
        first.map(|(tick, _)| *tick)
    }

    /// The last value of a page of health.
    pub fn page(&self, number: u8) -> Option<u32> {
        let last = self.health.iter().rev().find(|page| page.page == number);
        last.map(|page| page.value)
    }

    /// The words of X.
    pub fn x(&self) -> impl Iterator<Item = &Axis> {
        self.axes.iter().filter(|axis| axis.axis == 0)
    }

    /// The outcomes of the requests with this token.
    pub fn outcomes(&self, token: u8) -> Vec<Option<Outcome>> {
        let own = self.answers.iter().filter(|answer| answer.token == token);
        own.map(|answer| answer.outcome).collect()
    }

    /// The last status on the bus.
    pub fn last_status(&self) -> Option<NodeStatus> {
        self.statuses.last().map(|(_, status)| *status)
    }
}

/// The frame of a command; `counter` rises from command to command.
pub fn command(request: Request, token: u8, counter: u8) -> BusFrame {
    let payload = Command::new(request, token).payload();
    let bytes = protect(Message::Command.key(), counter, payload);
    BusFrame::new(Message::Command.id(), &bytes).expect("eight bytes")
}
