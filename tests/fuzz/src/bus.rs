//! Bytes become events on a bus: mostly frames with a right check, since no fuzzer finds one.

use embedded_can::{ExtendedId, Frame, StandardId};
use hal_adapters::can::e2e::{Payload, protect};
use hal_adapters::can::table::TABLE;
use hal_adapters::can::{BusFrame, Message};

/// Bytes of a step.
const STEP_BYTES: usize = 11;

/// What happens.
#[derive(Clone, Copy, Debug)]
pub enum Step {
    /// A frame comes.
    Frame(BusFrame),
    /// So many ticks of 2 ms pass.
    Ticks(u8),
    /// So many us pass.
    Wait(u32),
}

/// Numbers the frames of each message, as their sender does.
#[derive(Default)]
pub struct Numbers([u8; TABLE.len()]);

impl Numbers {
    /// The next frame of a message, in order.
    pub fn frame(&mut self, message: Message, payload: Payload) -> BusFrame {
        let number = &mut self.0[message as usize];
        *number = number.wrapping_add(1);
        sealed(message, *number, payload)
    }
}

fn sealed(message: Message, number: u8, payload: Payload) -> BusFrame {
    let bytes = protect(message.key(), number, payload);
    BusFrame::new(message.id(), &bytes).expect("eight bytes")
}

/// The steps that bytes stand for: kind, message or identifier, counter, eight bytes each.
pub fn steps<'d>(data: &'d [u8], numbers: &'d mut Numbers) -> impl Iterator<Item = Step> + 'd {
    data.chunks_exact(STEP_BYTES).map(|step| {
        let (kind, which, counter) = (step[0], step[1], step[2]);
        let bytes: [u8; 8] = step[3..].try_into().expect("eight bytes");
        let word = u64::from_le_bytes(bytes);
        let payload = Payload {
            short: (word >> 32) as u32,
            long: word as u32,
        };
        let message = TABLE[usize::from(which) % TABLE.len()].message;
        match kind % 8 {
            0..=3 => Step::Frame(numbers.frame(message, payload)),
            4 => Step::Frame(sealed(message, counter, payload)),
            5 => Step::Frame(any_frame(which, counter, &bytes)),
            6 => Step::Ticks(which),
            _ => Step::Wait(word as u32),
        }
    })
}

/// A frame as no node sends it, or another protocol's.
fn any_frame(which: u8, form: u8, bytes: &[u8; 8]) -> BusFrame {
    let standard = StandardId::new(u16::from(which) | u16::from(form & 7) << 8);
    let standard = standard.expect("eleven bits");
    let extended = ExtendedId::new(u32::from(which) << 8).expect("16 bits");
    let data = &bytes[..usize::from(form >> 4).min(8)];
    let frame = match form & 0b1100 {
        0 => BusFrame::new(extended, data),
        4 => BusFrame::new_remote(standard, data.len()),
        _ => BusFrame::new(standard, data),
    };
    frame.expect("up to eight bytes")
}
