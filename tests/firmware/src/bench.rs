//! What every check starts from: images, blobs, the log and the poses that the host decodes
//! from it; and what the frames on the bus say.

use crate::adc_model::{Part, Row};
use crate::can_model::Sent;
use crate::image::Image;
use crate::machine::Machine;
use embedded_can::{Frame, Id, StandardId};
use hal_adapters::can::command::{Answer, Command, IdentityPage, Request};
use hal_adapters::can::e2e::{protect, unprotect};
use hal_adapters::can::status::{HealthPage, NodeState, NodeStatus};
use hal_adapters::can::{BusFrame, Message};
use runtime::frame::MISSING_CODE;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

/// Bits of the six words of a pose, X, Y, Rz, Z, Rx, Ry, and its status.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Words {
    /// The six words.
    pub words: [u32; 6],
    /// The status.
    pub status: u32,
}

/// Number of a second stage on the bus.
pub const NEIGHBOUR: u32 = 5;
/// Its servo period, us.
pub const NEIGHBOUR_PERIOD_US: u64 = 1000;

/// Everything that the script prepared.
pub struct Bench {
    /// The emulator's library.
    pub library: OsString,
    /// The programs for both converters.
    pub images: [Image; 2],
    /// The program for the ADS8688 as [`NEIGHBOUR`] with a servo period of [`NEIGHBOUR_PERIOD_US`].
    pub neighbour: Image,
    /// The blob of the log, of serial `stage-7`.
    pub blob: Vec<u8>,
    /// The same calibration, made later.
    pub later: Vec<u8>,
    /// A blob of another stage.
    pub other: Vec<u8>,
    /// The codes of the log.
    pub rows: Vec<Row>,
    /// What `host-fit decode` makes of them.
    pub poses: Vec<Words>,
}

type Failure = Box<dyn std::error::Error>;

impl Bench {
    /// Reads what lies in `folder`.
    pub fn read(folder: &Path, library: OsString) -> Result<Self, Failure> {
        let file = |name: &str| -> PathBuf { folder.join(name) };
        let bytes = |name: &str| std::fs::read(file(name)).map_err(|e| format!("{name}: {e}"));
        Ok(Self {
            library,
            images: [
                Image::read(&file("ads131m08.elf"))?,
                Image::read(&file("ads8688.elf"))?,
            ],
            neighbour: Image::read(&file("neighbour.elf"))?,
            blob: bytes("params.bin")?,
            later: bytes("later.bin")?,
            other: bytes("other.bin")?,
            rows: rows(&std::fs::read_to_string(file("log.csv"))?)?,
            poses: poses(&std::fs::read_to_string(file("pose.csv"))?)?,
        })
    }

    /// The program for a part.
    pub fn image(&self, part: Part) -> &Image {
        match part {
            Part::Ads131m08 => &self.images[0],
            Part::Ads8688 => &self.images[1],
        }
    }

    /// A controller with these parameter slots, whose converter plays the log.
    pub fn machine(&self, part: Part, slots: [&[u8]; 2]) -> Result<Machine, Failure> {
        self.machine_playing(part, slots, self.rows.clone())
    }

    /// The same with the blob of the log, after so many ticks; what it sent is forgotten.
    pub fn running(&self, part: Part, ticks: u64) -> Result<Machine, Failure> {
        let mut machine = self.machine(part, [&self.blob, &[]])?;
        machine.run_ticks(ticks)?;
        machine.chip.can.sent.clear();
        Ok(machine)
    }

    /// A controller whose converter plays these rows.
    pub fn machine_playing(
        &self,
        part: Part,
        slots: [&[u8]; 2],
        rows: Vec<Row>,
    ) -> Result<Machine, Failure> {
        Machine::new(&self.library, self.image(part), part, rows, slots)
    }
}

fn columns(header: &str, names: [&str; 6]) -> Result<[usize; 6], String> {
    let found = names.map(|name| header.split(',').position(|cell| cell == name));
    let mut at = [0; 6];
    for (at, (found, name)) in at.iter_mut().zip(found.into_iter().zip(names)) {
        *at = found.ok_or_else(|| format!("no column {name}"))?;
    }
    Ok(at)
}

/// The codes of a log.
pub fn rows(text: &str) -> Result<Vec<Row>, Failure> {
    let mut lines = text.lines();
    let names = [
        "hall_a_cnt",
        "hall_b_cnt",
        "hall_c_cnt",
        "cap1_cnt",
        "cap2_cnt",
        "cap3_cnt",
    ];
    let at = columns(lines.next().unwrap_or_default(), names)?;
    let row = |line: &str| -> Result<Row, Failure> {
        let cells: Vec<_> = line.split(',').collect();
        let mut row = [0; 6];
        for (code, at) in row.iter_mut().zip(at) {
            *code = cells.get(at).ok_or("a short line")?.parse()?;
        }
        Ok(row)
    };
    lines.map(row).collect()
}

fn poses(text: &str) -> Result<Vec<Words>, Failure> {
    let mut lines = text.lines();
    let names = ["x_um", "y_um", "rz_urad", "z_um", "rx_urad", "ry_urad"];
    let at = columns(lines.next().unwrap_or_default(), names)?;
    let pose = |line: &str| -> Result<Words, Failure> {
        let cells: Vec<_> = line.split(',').collect();
        let mut words = [0; 6];
        for (word, at) in words.iter_mut().zip(at) {
            let micro: f64 = cells.get(at).ok_or("a short line")?.parse()?;
            *word = ((micro * 1e-6) as f32).to_bits();
        }
        let status = cells.last().ok_or("a short line")?.parse()?;
        Ok(Words { words, status })
    };
    lines.map(pose).collect()
}

/// One axis of one tick, as it came over the bus.
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

/// What was on the bus, by kind, each with its tick.
#[derive(Default)]
pub struct Seen {
    /// Poses.
    pub axes: Vec<Axis>,
    /// States.
    pub statuses: Vec<(u64, NodeStatus)>,
    /// Answers.
    pub answers: Vec<(u64, Answer)>,
    /// Counters.
    pub health: Vec<HealthPage>,
    /// Text of the identity pages.
    pub identity: Vec<u8>,
    /// Number and time of ticks, us, by the controller.
    pub times: Vec<(u32, u32)>,
    /// Temperatures of mount and body, m degC, each from its tick on.
    pub temperatures: Vec<(u64, [i32; 2])>,
    /// Frames of codes and temperatures, and when they were sent completely, ns.
    pub codes: Vec<(u64, BusFrame)>,
    /// Frames whose check fails or that are none of the protocol's.
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
    /// Takes what was sent since the last look.
    pub fn since_last(machine: &mut Machine) -> Self {
        let first_ns = machine.chip.first_tick_ns.unwrap_or(0);
        let mut seen = Self::default();
        for sent in std::mem::take(&mut machine.chip.can.sent) {
            seen.take(&sent, first_ns);
        }
        seen
    }

    /// Takes one frame.
    pub fn take(&mut self, sent: &Sent, first_ns: u64) {
        let since_ns = sent.asked_ns.saturating_sub(first_ns);
        let tick = since_ns / 2_000_000;
        let id = StandardId::new(sent.id).map(Id::Standard);
        let message = id.and_then(Message::from_id);
        let read = message.and_then(|m| Some((m, unprotect(m.spec().key, &sent.bytes)?.1)));
        let Some((message, payload)) = read else {
            self.damaged += 1;
            return;
        };
        match message {
            Message::NodeStatus => self
                .statuses
                .push((tick, NodeStatus::from_payload(payload))),
            Message::Health => self.health.push(HealthPage::from_payload(payload)),
            Message::Answer => self.answers.push((tick, Answer::from_payload(payload))),
            Message::Identity => {
                self.identity
                    .extend(IdentityPage::from_payload(payload).text);
            }
            Message::PoseTime | Message::SensorTime => {
                self.times.push((payload.short, payload.long));
            }
            Message::Temperature => {
                let signed = |word: u32, bits: u32| (word << (32 - bits)) as i32 >> (32 - bits);
                let [mount, body] = [(payload.short, 20, 24), (payload.long, 24, 25)].map(
                    |(word, bits, missing)| match payload.long >> missing & 1 {
                        0 => signed(word, bits),
                        _ => MISSING_CODE,
                    },
                );
                self.temperatures.push((tick, [mount, body]));
                let frame = BusFrame::new(message.id(), &sent.bytes);
                self.codes.extend(frame.map(|frame| (sent.done_ns, frame)));
            }
            Message::Hall
            | Message::Capacitive
            | Message::HallAb24
            | Message::HallCCapacitive1At24
            | Message::Capacitive23At24 => {
                let frame = BusFrame::new(message.id(), &sent.bytes);
                self.codes.extend(frame.map(|frame| (sent.done_ns, frame)));
            }
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

    /// Frames of codes: those of temperatures come unasked.
    pub fn recorded(&self) -> usize {
        self.codes.len() - self.temperatures.len()
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

    /// The last number of missed ticks.
    pub fn missed_ticks(&self) -> Option<u16> {
        self.last_status().map(|status| status.missed_ticks)
    }

    /// The last status on the bus.
    pub fn last_status(&self) -> Option<NodeStatus> {
        self.statuses.last().map(|(_, status)| *status)
    }
}

/// Words on the bus beside those of the host.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Comparison {
    /// Words compared.
    pub words: u64,
    /// Words or statuses that differ.
    pub differing: u64,
    /// Planar poses among them.
    pub planar: u64,
}

impl Comparison {
    /// Compares poses of ticks from `first` on with those that the host decodes.
    pub fn add(&mut self, axes: &[Axis], poses: &[Words], first: u64) {
        for axis in axes.iter().filter(|axis| axis.tick >= first) {
            let want = poses[axis.tick as usize % poses.len()];
            self.words += 1;
            self.planar += u64::from(axis.axis == 0);
            let same = want.words[axis.axis] == axis.word && want.status == axis.status;
            self.differing += u64::from(!same);
        }
    }
}

/// The bytes of a command with its identifier; `counter` rises from command to command.
pub fn command(request: Request, token: u8, counter: u8) -> (u16, [u8; 8]) {
    let payload = Command::new(request, token).payload();
    let spec = Message::Command.spec();
    (spec.id, protect(spec.key, counter, payload))
}
