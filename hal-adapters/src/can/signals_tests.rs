//! What each message carries: who sends it, when, and its signals. Bits are numbered as in a
//! `.dbc` file, little-endian: bit 8 n is the lowest of byte n. Check and counter take bits 0 to
//! 11 of every message.

use super::table::{Message as M, SLOW_TICKS, Spec, TABLE, VERTICAL_TICKS};

/// Who sends a message, by its name in the `.dbc` file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Node {
    /// The data-acquisition node with the converters.
    Sensor,
    /// The node that decodes: a controller or a computer.
    Decoder,
    /// Whoever commands it.
    Host,
}

impl Node {
    /// Every node.
    pub(super) const ALL: [Self; 3] = [Self::Sensor, Self::Decoder, Self::Host];
}

/// When a message is sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Rate {
    /// Every so many ticks.
    Ticks(u8),
    /// Every so many ticks by default; the sender can be set to 1 to 16.
    Decimated(u8),
    /// When asked for.
    OnRequest,
}

/// How a signal's bits are read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// Unsigned integer.
    Unsigned,
    /// Two's complement.
    Signed,
    /// IEEE 754 single precision, 32 bits.
    Float,
    /// Selects which of the paged signals the frame carries.
    Selector,
}

/// One signal.
#[derive(Clone, Copy, Debug)]
pub(super) struct Signal {
    /// Its name in the `.dbc` file.
    pub(super) name: &'static str,
    /// Lowest bit.
    pub(super) start: u8,
    /// How many bits.
    pub(super) bits: u8,
    /// How they are read.
    pub(super) kind: Kind,
    /// Unit; empty for none.
    pub(super) unit: &'static str,
    /// The value of the selector with which a paged signal is sent.
    pub(super) page: Option<u8>,
    /// Named values.
    pub(super) values: &'static [(u8, &'static str)],
    /// What it means.
    pub(super) what: &'static str,
}

const fn signal(
    name: &'static str,
    (start, bits): (u8, u8),
    kind: Kind,
    unit: &'static str,
    what: &'static str,
) -> Signal {
    Signal {
        name,
        start,
        bits,
        kind,
        unit,
        page: None,
        values: &[],
        what,
    }
}

const fn unsigned(name: &'static str, at: (u8, u8), what: &'static str) -> Signal {
    signal(name, at, U, "", what)
}

const fn named(signal: Signal, values: &'static [(u8, &'static str)]) -> Signal {
    Signal { values, ..signal }
}

const fn paged(page: u8, name: &'static str, what: &'static str) -> Signal {
    Signal {
        page: Some(page),
        ..signal(name, (32, 32), U, "", what)
    }
}

use Kind::{Float as F, Selector, Signed as S, Unsigned as U};

/// Check and counter: the first signals of every message.
pub(super) const PROTECTION: [Signal; 2] = [
    unsigned("Check", (0, 8), "CRC-8, see E2E Profile 2"),
    unsigned("Counter", (8, 4), "frames of this message, modulo 16"),
];

const fn code(name: &'static str, start: u8, bits: u8) -> Signal {
    signal(
        name,
        (start, bits),
        S,
        "count",
        "converter code; 0 if missing",
    )
}

const fn missing(bits: u8, what: &'static str) -> Signal {
    signal("Missing", (12, bits), U, "", what)
}

const THREE: &str = "bit k set: code k was not measured in this tick";
const TWO: &str = "bit k set: code k of this frame was not measured in this tick";

const HALL: [Signal; 4] = [
    missing(3, THREE),
    code("HallA", 16, 16),
    code("HallB", 32, 16),
    code("HallC", 48, 16),
];
const CAPACITIVE: [Signal; 4] = [
    missing(3, THREE),
    code("Capacitive1", 16, 16),
    code("Capacitive2", 32, 16),
    code("Capacitive3", 48, 16),
];
const HALL_AB_24: [Signal; 3] = [
    missing(2, TWO),
    code("HallA", 16, 24),
    code("HallB", 40, 24),
];
const HALL_C_CAPACITIVE_1_24: [Signal; 3] = [
    missing(2, TWO),
    code("HallC", 16, 24),
    code("Capacitive1", 40, 24),
];
const CAPACITIVE_23_24: [Signal; 3] = [
    missing(2, TWO),
    code("Capacitive2", 16, 24),
    code("Capacitive3", 40, 24),
];

const fn tick_time() -> [Signal; 2] {
    [
        unsigned("Sequence", (12, 20), "number of the tick, modulo 2^20"),
        signal(
            "Time",
            (32, 32),
            U,
            "us",
            "when its codes were sampled, wrapping",
        ),
    ]
}

const SENSOR_TIME: [Signal; 2] = tick_time();
const POSE_TIME: [Signal; 2] = tick_time();

const fn axis(name: &'static str, unit: &'static str) -> [Signal; 2] {
    [
        unsigned(
            "Status",
            (12, 20),
            "bit mask of runtime::status; 0 when all is good",
        ),
        signal(
            name,
            (32, 32),
            F,
            unit,
            "the decoder's own word; 0 if invalid",
        ),
    ]
}

const POSE_X: [Signal; 2] = axis("X", "m");
const POSE_Y: [Signal; 2] = axis("Y", "m");
const POSE_RZ: [Signal; 2] = axis("Rz", "rad");
const POSE_Z: [Signal; 2] = axis("Z", "m");
const POSE_RX: [Signal; 2] = axis("Rx", "rad");
const POSE_RY: [Signal; 2] = axis("Ry", "rad");

#[rustfmt::skip]
const NODE_STATUS: [Signal; 6] = [
    named(
        unsigned("State", (12, 4), "what the node is doing"),
        &[(0, "starting"), (1, "running"), (2, "no parameters"), (3, "bad parameters"), (4, "no frames"), (5, "sensor fault"), (6, "self-test failed"), (7, "updating"), (8, "stopped")],
    ),
    unsigned("Reason", (16, 8), "detail of the state, by the node; 0 for none"),
    unsigned("Flags", (24, 8), "1 reset by the watchdog or on a fault, 2 bus was off, 4 re-zero runs, 8 a zero deviation is subtracted, 16 re-zero refused, 32 identifying, 64 core on its internal oscillator, 128 recording"),
    unsigned("MissedTicks", (32, 16), "ticks that came late or not at all; stays at 65535"),
    unsigned("BusOff", (48, 8), "times the bus was off; stays at 255"),
    unsigned("Version", (56, 8), "version of this protocol"),
];

const COMMANDS: &[(u8, &str)] = &[
    (1, "re-zero"),
    (2, "identify"),
    (3, "clear zero"),
    (4, "record"),
    (5, "servo off"),
    (6, "challenge"),
    (7, "begin update"),
    (9, "commit update"),
    (10, "abort update"),
    (11, "activate"),
    (13, "read back"),
    (14, "tell"),
];

#[rustfmt::skip]
const COMMAND: [Signal; 3] = [
    named(unsigned("Command", (12, 4), "what is asked for"), COMMANDS),
    unsigned("Token", (16, 8), "chosen by the sender, another each time; returned in the answer; commit and abort update: that of begin update"),
    unsigned("Argument", (32, 32), "re-zero: ticks to average, 0 for the default; identify: s to blink; record: 1 on, 0 off; servo off: s, 0 for servo on; challenge: word of the nonce, 0 to 3; begin update: length in bytes (0 to go back) in bits 0 to 15, low half of the blob's CRC-32C in bits 16 to 31; commit update: sequence number; read back: index of the word; tell: page; else 0"),
];

#[rustfmt::skip]
const ANSWER: [Signal; 4] = [
    named(unsigned("Command", (12, 4), "what was asked for"), COMMANDS),
    unsigned("Token", (16, 8), "the token of the request"),
    named(
        unsigned("Outcome", (24, 8), "how it ended"),
        &[(0, "done"), (1, "started"), (2, "unknown command"), (3, "no parameters"), (4, "too short"), (5, "no pose"), (6, "stage moved"), (7, "stage drifted"), (8, "busy"), (9, "servo on: declare it off first"), (10, "out of bounds"), (11, "extrapolated"), (12, "not authorised"), (13, "bad content"), (14, "wrong sequence number"), (15, "supply too low"), (16, "incomplete"), (17, "store failed"), (18, "no transfer"), (19, "no random number")],
    ),
    unsigned("Detail", (32, 32), "stage moved, drifted or out of bounds: axis, 0 to 5 for X, Y, Rz, Z, Rx, Ry; no pose or extrapolated: status; bad content: kind, as in the node's reason; wrong sequence number: the one that is taken; incomplete: the first missing index; done: begin update: its argument, commit update: the blob's CRC-32C, challenge, read back, tell: the word asked for; else 0"),
];

#[rustfmt::skip]
const HEALTH: [Signal; 13] = [
    signal("Page", (12, 4), Selector, "", "which counter, or which fact of the board"),
    paged(0, "Ticks", "ticks, with and without a frame"),
    paged(1, "PlanarInvalid", "ticks whose planar pose was invalid"),
    paged(
        2,
        "VerticalInvalid",
        "ticks whose vertical pose was invalid",
    ),
    paged(3, "Held", "ticks in which a value was held"),
    paged(4, "FramesMissed", "servo periods without a frame"),
    paged(5, "FramesRepeated", "frames that were not new"),
    paged(6, "LastFault", "last fault since power-on: bits 0 to 7: 0 none, 1 panic, 2 hard fault, 3 stack overflow, 4 clock failed, 5 watchdog; bits 8 to 15: step of the start-up, 0 when ticking"),
    paged(7, "FaultAddress", "where: program counter; of a panic its place in flash, of a stack overflow the stack pointer"),
    paged(8, "FaultDetail", "CFSR of that fault, or what its kind needs"),
    paged(9, "Faults", "resets by faults since power-on"),
    paged(10, "OptionBytes", "the word FLASH_OPTCR"),
    paged(11, "BoardChecks", "bits: 0 no pull-up on chip select, 1 none on SYNC or RST, 2 brown-out level below 2.7 V, 3 internal oscillator, 4 CAN did not start, 5 retained zero lost, 6 supply below 2.9 V"),
];

const UPDATE_DATA: [Signal; 3] = [
    unsigned("Token", (12, 8), "token of the update"),
    unsigned(
        "Index",
        (20, 8),
        "which word: of the blob from 0, of the tag from 240",
    ),
    unsigned("Word", (32, 32), "four bytes, the first in bits 32 to 39"),
];

const IDENTITY: [Signal; 3] = [
    unsigned("Part", (12, 4), "page, 0 to 5; six characters each"),
    unsigned(
        "Text12",
        (16, 16),
        "characters 1 and 2 of the page, UTF-8, 0 at the end",
    ),
    unsigned("Text3456", (32, 32), "characters 3 to 6 of the page"),
];

/// What a message carries.
#[derive(Clone, Copy, Debug)]
pub(super) struct Row {
    /// Name, identifier and key.
    pub(super) spec: Spec,
    /// Who sends it.
    pub(super) sender: Node,
    /// When.
    pub(super) rate: Rate,
    /// What it carries.
    pub(super) what: &'static str,
    /// Its signals besides check and counter.
    pub(super) signals: &'static [Signal],
}

const fn row(
    message: M,
    sender: Node,
    rate: Rate,
    what: &'static str,
    signals: &'static [Signal],
) -> Row {
    Row {
        spec: *message.spec(),
        sender,
        rate,
        what,
        signals,
    }
}

use Node::{Decoder, Host, Sensor};

const EVERY: Rate = Rate::Ticks(1);
const SLOW: Rate = Rate::Ticks(SLOW_TICKS);
const VERTICAL: Rate = Rate::Decimated(VERTICAL_TICKS);

/// The messages, in their order.
#[rustfmt::skip]
pub(super) const ROWS: [Row; 19] = [
    row(M::Hall, Sensor, EVERY, "Hall codes of 16 bits", &HALL),
    row(M::Capacitive, Sensor, EVERY, "capacitive codes of 16 bits", &CAPACITIVE),
    row(M::HallAb24, Sensor, EVERY, "second layout: Hall codes A and B of up to 24 bits", &HALL_AB_24),
    row(M::HallCCapacitive1At24, Sensor, EVERY, "second layout: Hall code C and capacitive code 1", &HALL_C_CAPACITIVE_1_24),
    row(M::Capacitive23At24, Sensor, EVERY, "second layout: capacitive codes 2 and 3", &CAPACITIVE_23_24),
    row(M::SensorTime, Sensor, SLOW, "number and time of the tick that follows", &SENSOR_TIME),
    row(M::PoseX, Decoder, EVERY, "X", &POSE_X),
    row(M::PoseY, Decoder, EVERY, "Y", &POSE_Y),
    row(M::PoseRz, Decoder, EVERY, "Rz", &POSE_RZ),
    row(M::PoseZ, Decoder, VERTICAL, "Z", &POSE_Z),
    row(M::PoseRx, Decoder, VERTICAL, "Rx", &POSE_RX),
    row(M::PoseRy, Decoder, VERTICAL, "Ry", &POSE_RY),
    row(M::NodeStatus, Decoder, SLOW, "what the decoding node is doing", &NODE_STATUS),
    row(M::Command, Host, Rate::OnRequest, "a request to the decoding node", &COMMAND),
    row(M::Answer, Decoder, Rate::OnRequest, "how a request ended", &ANSWER),
    row(M::Health, Decoder, SLOW, "counters since start, one a frame", &HEALTH),
    row(M::Identity, Decoder, Rate::OnRequest, "serial number of the stage, six characters a page", &IDENTITY),
    row(M::PoseTime, Decoder, SLOW, "number and time of the tick whose X, Y, Rz came before it", &POSE_TIME),
    row(M::UpdateData, Host, Rate::OnRequest, "a word of new parameters, or of the tag that authorises them", &UPDATE_DATA),
];

#[test]
fn no_two_signals_of_a_frame_share_a_bit() {
    for row in &ROWS {
        let pages = row.signals.iter().filter_map(|s| s.page).max();
        for page in 0..=pages.unwrap_or(0) {
            let mut used = 0u64;
            for s in PROTECTION.iter().chain(row.signals) {
                if s.page.is_some_and(|p| p != page) {
                    continue;
                }
                assert!(s.bits >= 1 && s.start + s.bits <= 64, "{}", s.name);
                let mask = (u64::MAX >> (64 - s.bits)) << s.start;
                assert_eq!(used & mask, 0, "{} {}", row.spec.message.name(), s.name);
                used |= mask;
                assert!(s.kind != Kind::Float || s.bits == 32);
            }
        }
    }
}

#[test]
fn every_message_of_the_table_is_described_in_its_order() {
    let described = ROWS.map(|row| row.spec.message);
    assert_eq!(described, TABLE.map(|row| row.message));
}
