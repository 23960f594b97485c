//! Bytes become events on a bus: mostly frames with a right check, since no fuzzer finds one.

use crate::PARAMS;
use embedded_can::{ExtendedId, Frame, StandardId};
use hal_adapters::can::command::{Command, Request};
use hal_adapters::can::e2e::{Payload, protect};
use hal_adapters::can::table::TABLE;
use hal_adapters::can::update::{UpdateData, UpdateRequest, word_at};
use hal_adapters::can::{BusFrame, Message};
use runtime::ParameterSet;
use runtime::blob::MAX_BYTES;
use runtime::parameters::Text;
use std::sync::LazyLock;

/// Other parameters of the stage of [`PARAMS`], which an update sends.
pub static NEW: LazyLock<Vec<u8>> = LazyLock::new(|| {
    let mut set = ParameterSet::from_bytes(PARAMS).expect("the blob of the examples");
    set.created = Text::try_from("later").expect("short");
    let mut buffer = [0; MAX_BYTES];
    set.to_bytes(&mut buffer).expect("room enough").to_vec()
});

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
    data.chunks_exact(STEP_BYTES).flat_map(|step| {
        let (kind, which, counter) = (step[0], step[1], step[2]);
        let bytes: [u8; 8] = step[3..].try_into().expect("eight bytes");
        let word = u64::from_le_bytes(bytes);
        let payload = Payload {
            short: (word >> 32) as u32,
            long: word as u32,
        };
        let message = TABLE[usize::from(which) % TABLE.len()].message;
        let step = match kind % 8 {
            0..=2 => Step::Frame(numbers.frame(message, payload)),
            3 => return update(numbers, which, counter),
            4 => Step::Frame(sealed(message, counter, payload)),
            5 => Step::Frame(any_frame(which, counter, &bytes)),
            6 => Step::Ticks(which),
            _ => Step::Wait(word as u32),
        };
        vec![step]
    })
}

/// A request of an update to [`NEW`], or its words up to `last`.
fn update(numbers: &mut Numbers, which: u8, last: u8) -> Vec<Step> {
    let request = match which % 8 {
        0 => Request::ServoOff { seconds: last },
        1 => Request::Update(UpdateRequest::Begin {
            bytes: NEW.len() as u16,
        }),
        2 => Request::Update(UpdateRequest::Commit { sequence: 1 }),
        3 => Request::Update(UpdateRequest::Activate),
        4 => Request::Update(UpdateRequest::Abort),
        _ => {
            let word = |index: u8| {
                let word = word_at(&NEW, index.into()).unwrap_or_default();
                let token = 0;
                let data = UpdateData { token, index, word };
                Step::Frame(numbers.frame(Message::UpdateData, data.payload()))
            };
            return (0..=last).map(word).collect();
        }
    };
    let payload = Command::new(request, 0).payload();
    vec![Step::Frame(numbers.frame(Message::Command, payload))]
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
