//! Sensor frames: the codes of one tick, in one of two layouts.
//!
//! Coding needs no state: the counter of each frame is the low nibble of the tick's number. So
//! every receiver notices a tick that the node skips.

use super::e2e::Payload;
use super::frame::{Coded, standard};
use super::notice::open;
use super::table::{Message, SLOW_TICKS};
use embedded_can::Frame;
use runtime::RawFrame;
use runtime::frame::MISSING_CODE;

/// How wide the codes are on the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layout {
    /// Codes of 16 bits: two frames a tick.
    Bits16,
    /// Codes of up to 24 bits, for parts of 18 and 24: three frames a tick.
    Bits24,
}

impl Layout {
    /// The messages of one tick, in the order on the bus.
    pub const fn messages(self) -> &'static [Message] {
        match self {
            Self::Bits16 => &[Message::Hall, Message::Capacitive],
            Self::Bits24 => &[
                Message::HallAb24,
                Message::HallCCapacitive1At24,
                Message::Capacitive23At24,
            ],
        }
    }

    /// The layout of a message with codes; `None` for any other message.
    pub fn from_message(message: Message) -> Option<Self> {
        let has = |layout: &Self| layout.messages().contains(&message);
        [Self::Bits16, Self::Bits24].into_iter().find(has)
    }

    /// The layout for a converter of `code_bits` bits.
    pub const fn from_bits(code_bits: u32) -> Self {
        match code_bits {
            0..=16 => Self::Bits16,
            _ => Self::Bits24,
        }
    }

    /// The narrowest layout that holds every code from `low` to `high`, or `None` if 24 bits
    /// are too few.
    pub const fn from_range(low: i32, high: i32) -> Option<Self> {
        if fits(low, 16) && fits(high, 16) {
            Some(Self::Bits16)
        } else if fits(low, 24) && fits(high, 24) {
            Some(Self::Bits24)
        } else {
            None
        }
    }
}

/// Whether `code` is a two's complement number of `bits` bits.
const fn fits(code: i32, bits: u32) -> bool {
    let top = 32 - bits;
    code << top >> top == code
}

/// The bits of a code, and 0; or 0 bits, and 1 for a code that is missing or too wide.
#[inline(always)]
const fn coded(code: i32, bits: u32) -> (u32, u32) {
    match fits(code, bits) {
        true => (code as u32 & (u32::MAX >> (32 - bits)), 0),
        false => (0, 1),
    }
}

#[inline(always)]
const fn three_codes([a, b, c]: [i32; 3]) -> Payload {
    let ((a, no_a), (b, no_b), (c, no_c)) = (coded(a, 16), coded(b, 16), coded(c, 16));
    Payload::new(a << 4 | no_c << 2 | no_b << 1 | no_a, c << 16 | b)
}

#[inline(always)]
const fn two_codes(a: i32, b: i32) -> Payload {
    let ((a, no_a), (b, no_b)) = (coded(a, 24), coded(b, 24));
    Payload::new((a & 0xffff) << 4 | no_b << 1 | no_a, b << 8 | a >> 16)
}

/// A code of `bits` bits in the low end of `word`, or [`MISSING_CODE`].
#[inline(always)]
const fn code(word: u32, bits: u32, is_missing: u32) -> i32 {
    if is_missing & 1 == 0 {
        let top = 32 - bits;
        (word << top) as i32 >> top
    } else {
        MISSING_CODE
    }
}

/// The three codes of a frame of [`Message::Hall`] or [`Message::Capacitive`].
#[inline(always)]
pub(super) const fn read_three(p: Payload) -> [i32; 3] {
    [
        code(p.short >> 4, 16, p.short),
        code(p.long, 16, p.short >> 1),
        code(p.long >> 16, 16, p.short >> 2),
    ]
}

/// The two codes of a frame of the 24-bit layout.
#[inline(always)]
pub(super) const fn read_two(p: Payload) -> [i32; 2] {
    let first = (p.short >> 4 & 0xffff) | p.long << 16;
    [
        code(first, 24, p.short),
        code(p.long >> 8, 24, p.short >> 1),
    ]
}

/// The two frames of a tick in the 16-bit layout. A code that does not fit is sent as
/// missing, never truncated.
#[inline(always)]
pub const fn frames_16(frame: &RawFrame) -> [Coded; 2] {
    let counter = frame.sequence;
    [
        Coded::new(Message::Hall, counter, three_codes(frame.hall)),
        Coded::new(Message::Capacitive, counter, three_codes(frame.capacitive)),
    ]
}

/// The three frames of a tick in the 24-bit layout; as [`frames_16`].
#[inline]
const fn frames_24(frame: &RawFrame) -> [Coded; 3] {
    let ([a, b, c], [g1, g2, g3]) = (frame.hall, frame.capacitive);
    let counter = frame.sequence;
    [
        Coded::new(Message::HallAb24, counter, two_codes(a, b)),
        Coded::new(Message::HallCCapacitive1At24, counter, two_codes(c, g1)),
        Coded::new(Message::Capacitive23At24, counter, two_codes(g2, g3)),
    ]
}

/// The frame with number and time of what was sampled; sent in every [`SLOW_TICKS`]th tick.
pub(super) fn time_frame(message: Message, sampled: &RawFrame, tick: u32) -> Option<Coded> {
    let slow = u32::from(SLOW_TICKS);
    let payload = Payload::new(sampled.sequence, sampled.time_us);
    (tick.is_multiple_of(slow)).then(|| Coded::new(message, tick / slow, payload))
}

/// From one frame of temperatures to the next while they stay the same, us.
pub const REPEAT_US: u32 = 100_000;
/// Bits of the mount's and of the body's temperature on the bus.
const TEMPERATURE_BITS: [u32; 2] = [20, 24];

/// Sends the temperatures of a node: when they change, and again after [`REPEAT_US`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TemperatureSender {
    sent_mc: [i32; 2],
    sent_us: u32,
    counter: u32,
}

impl TemperatureSender {
    /// A sender of a node that has sent none.
    pub const START: Self = Self {
        sent_mc: [MISSING_CODE; 2],
        sent_us: 0,
        counter: 0,
    };

    /// The frame that is due before the codes of a tick. A node without thermometers has none.
    pub const fn frame(&mut self, tick: &RawFrame) -> Option<Coded> {
        let ([mount, body], [sent_mount, sent_body]) = (tick.temperature_mc, self.sent_mc);
        let is_new = mount != sent_mount || body != sent_body;
        let is_there = mount != MISSING_CODE || body != MISSING_CODE;
        let is_over = tick.time_us.wrapping_sub(self.sent_us) >= REPEAT_US;
        if !(is_new || is_there && is_over) {
            return None;
        }
        self.sent_mc = tick.temperature_mc;
        self.sent_us = tick.time_us;
        self.counter = self.counter.wrapping_add(1);
        let [mount_bits, body_bits] = TEMPERATURE_BITS;
        let ((mount, no_mount), (body, no_body)) =
            (coded(mount, mount_bits), coded(body, body_bits));
        let payload = Payload::new(mount, no_body << 25 | no_mount << 24 | body);
        Some(Coded::new(Message::Temperature, self.counter, payload))
    }
}

/// Mount and body, m degC, of a frame of [`Message::Temperature`].
pub const fn read_temperature_mc(p: Payload) -> [i32; 2] {
    let [mount_bits, body_bits] = TEMPERATURE_BITS;
    [
        code(p.short, mount_bits, p.long >> 24),
        code(p.long, body_bits, p.long >> 25),
    ]
}

/// Number and time of a tick, as [`Message::SensorTime`] carries them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TickTime {
    /// The number that the sensor node gave it, modulo 2^20.
    pub sequence: u32,
    /// When its codes were sampled by the node's clock, us, wrapping.
    pub time_us: u32,
}

/// The content of a time frame; `None` for any other frame and for a damaged one.
pub fn read_time<F: Frame>(frame: &F) -> Option<TickTime> {
    let (id, data) = standard(frame)?;
    if id != Message::SensorTime.id() {
        return None;
    }
    let (_, payload) = open(Message::SensorTime, data).ok()?;
    Some(TickTime {
        sequence: payload.short,
        time_us: payload.long,
    })
}

/// Every frame of a tick in the order on the bus: its time before its codes.
pub fn frames(layout: Layout, frame: &RawFrame) -> impl Iterator<Item = Coded> + use<> {
    let codes = match layout {
        Layout::Bits16 => {
            let [a, b] = frames_16(frame);
            [Some(a), Some(b), None]
        }
        Layout::Bits24 => frames_24(frame).map(Some),
    };
    time_frame(Message::SensorTime, frame, frame.sequence)
        .into_iter()
        .chain(codes.into_iter().flatten())
}

#[cfg(test)]
mod tests {
    use super::super::e2e::unprotect;
    use super::super::frame::BusFrame;
    use super::*;
    use proptest::prelude::*;

    const FRAME: RawFrame = RawFrame::new(
        [0x1234, -2, i16::MIN as i32],
        [1, MISSING_CODE, 70000],
        0x35,
        7,
    );

    #[test]
    fn sixteen_bit_frames_worked_by_hand() {
        let [hall, gaps] = frames_16(&FRAME);
        // Counter 5, nothing missing, then 0x1234, -2 = 0xfffe, -32768 = 0x8000, low byte first.
        assert_eq!(hall.bytes[1..], [0x05, 0x34, 0x12, 0xfe, 0xff, 0x00, 0x80]);
        // Codes 2 (missing) and 3 (does not fit) are flagged, bits 1 and 2, and sent as 0.
        assert_eq!(gaps.bytes[1..], [0x65, 0x01, 0, 0, 0, 0, 0]);
    }

    #[test]
    fn twenty_four_bit_frames_worked_by_hand() {
        let [first, second, third] = frames_24(&FRAME);
        assert_eq!(first.bytes[1..], [0x05, 0x34, 0x12, 0x00, 0xfe, 0xff, 0xff]);
        assert_eq!(
            second.bytes[1..],
            [0x05, 0x00, 0x80, 0xff, 0x01, 0x00, 0x00]
        );
        // 70000 = 0x11170; capacitive code 2, the first of this frame, is missing.
        assert_eq!(third.bytes[1..], [0x15, 0, 0, 0, 0x70, 0x11, 0x01]);
    }

    #[test]
    fn every_sixteenth_tick_tells_its_number_and_time() {
        let at = |sequence| RawFrame { sequence, ..FRAME };
        let time_frame = |frame: &RawFrame| time_frame(Message::SensorTime, frame, frame.sequence);
        let sent: Option<Coded> = time_frame(&at(0x1_2340));
        // Counter 4 of this message's own frames, sequence 0x12340, time 7.
        let bytes = sent.expect("a sixteenth tick").bytes;
        assert_eq!(bytes[1..], [0x04, 0x34, 0x12, 7, 0, 0, 0]);
        let sent = sent.map(BusFrame::from).expect("a sixteenth tick");
        let time = TickTime {
            sequence: 0x1_2340,
            time_us: 7,
        };
        assert_eq!(read_time(&sent), Some(time));
        assert_eq!(read_time(&sent.flipped(1)), None);
        assert_eq!(read_time(&BusFrame::from(frames_16(&FRAME)[0])), None);
        assert_eq!(time_frame(&at(0x1_2341)), None);
        assert_eq!(frames(Layout::Bits16, &at(0)).count(), 3);
        assert_eq!(frames(Layout::Bits24, &at(1)).count(), 3);
    }

    #[test]
    fn temperatures_worked_by_hand_and_back() {
        let mut sender = TemperatureSender::START;
        let mut frame = |temperature_mc: [i32; 2], time_us| {
            let tick = RawFrame { time_us, ..FRAME }.with_temperature_mc(temperature_mc);
            sender.frame(&tick).map(|frame| frame.bytes)
        };
        assert_eq!(frame([MISSING_CODE; 2], 200_000), None);
        // 21,500 = 0x53fc and -1: counter 1, nothing missing.
        let bytes = frame([21_500, -1], 200_000).expect("new");
        assert_eq!(bytes[1..], [0xc1, 0x3f, 0x05, 0xff, 0xff, 0xff, 0x00]);
        assert_eq!(frame([21_500, -1], 299_999), None);
        let again = frame([21_500, -1], 300_000).expect("after 100 ms");
        assert_eq!(again[1], 0xc2);
        let bytes = frame([MISSING_CODE, 5], 302_000).expect("one is lost");
        assert_eq!(bytes[1..], [0x03, 0, 0, 5, 0, 0, 1]);
        for sent in [
            [-40_000, 65_000],
            [MISSING_CODE, 5],
            [5, MISSING_CODE],
            [MISSING_CODE; 2],
        ] {
            let bytes = frame(sent, 304_000).expect("new");
            let (_, payload) = unprotect(Message::Temperature.key(), &bytes).expect("sound");
            assert_eq!(read_temperature_mc(payload), sent);
        }
        // Gone for good: the receiver forgets by itself.
        assert_eq!(frame([MISSING_CODE; 2], 900_000), None);
    }

    #[test]
    fn the_narrowest_layout_is_taken() {
        assert_eq!(Layout::from_range(-32768, 32767), Some(Layout::Bits16));
        assert_eq!(Layout::from_range(-32769, 0), Some(Layout::Bits24));
        assert_eq!(Layout::from_range(0, 1 << 23), None);
        for layout in [Layout::Bits16, Layout::Bits24] {
            for message in layout.messages() {
                assert_eq!(Layout::from_message(*message), Some(layout));
            }
        }
        assert_eq!(Layout::from_message(Message::SensorTime), None);
    }

    proptest! {
        #[test]
        fn codes_of_their_width_come_back_and_others_are_missing(hall: [i32; 3], capacitive: [i32; 3], shift in 0u32..24) {
            let frame = RawFrame { hall: hall.map(|c| c >> shift), capacitive: capacitive.map(|c| c >> shift), ..FRAME };
            let want = |code: i32, bits: u32| {
                let half = 1i64 << (bits - 1);
                if (-half..half).contains(&i64::from(code)) { code } else { MISSING_CODE }
            };
            let payload = |c: Coded| unprotect(c.message.key(), &c.bytes).expect("sound").1;
            let [h, g] = frames_16(&frame).map(payload).map(read_three);
            prop_assert_eq!(h, frame.hall.map(|c| want(c, 16)));
            prop_assert_eq!(g, frame.capacitive.map(|c| want(c, 16)));
            let [[a, b], [c, g1], [g2, g3]] = frames_24(&frame).map(payload).map(read_two);
            prop_assert_eq!([a, b, c], frame.hall.map(|c| want(c, 24)));
            prop_assert_eq!([g1, g2, g3], frame.capacitive.map(|c| want(c, 24)));
        }
    }
}
