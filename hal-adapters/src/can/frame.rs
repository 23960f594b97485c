//! Frames by value: [`Coded`], ready for any CAN controller, and [`BusFrame`], for receivers and logs.

use super::e2e::{Payload, protect};
use super::table::Message;
use embedded_can::{Frame, Id, StandardId};

/// A protected frame, ready to be sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Coded {
    /// The message.
    pub message: Message,
    /// Its eight bytes.
    pub bytes: [u8; 8],
}

impl Coded {
    /// The frame with this counter; only its low nibble is sent.
    #[inline(always)]
    pub(super) const fn new(message: Message, counter: u32, payload: Payload) -> Self {
        Self {
            message,
            bytes: protect(message.key(), counter as u8, payload),
        }
    }

    /// The frame in the type of a CAN driver. `None` only if this type refuses eight bytes.
    pub fn to_frame<F: Frame>(&self) -> Option<F> {
        F::new(self.message.id(), &self.bytes)
    }
}

/// A classic CAN frame by value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BusFrame {
    /// Identifier, standard or extended.
    pub id: Id,
    /// Data length, 0 to 8.
    length: u8,
    remote: bool,
    bytes: [u8; 8],
}

impl From<Coded> for BusFrame {
    fn from(coded: Coded) -> Self {
        Self::data_frame(Id::Standard(coded.message.id()), 8, coded.bytes)
    }
}

impl BusFrame {
    const fn data_frame(id: Id, length: u8, bytes: [u8; 8]) -> Self {
        Self {
            id,
            length,
            remote: false,
            bytes,
        }
    }

    /// The same data under another identifier.
    pub(super) const fn with_id(&self, id: Id) -> Self {
        Self { id, ..*self }
    }

    /// A copy of any frame.
    pub fn from_frame<F: Frame>(frame: &F) -> Self {
        let mut bytes = [0; 8];
        for (to, from) in bytes.iter_mut().zip(frame.data()) {
            *to = *from;
        }
        Self {
            remote: frame.is_remote_frame(),
            ..Self::data_frame(frame.id(), frame.dlc().min(8) as u8, bytes)
        }
    }
}

impl Frame for BusFrame {
    fn new(id: impl Into<Id>, data: &[u8]) -> Option<Self> {
        let mut bytes = [0; 8];
        bytes.get_mut(..data.len())?.copy_from_slice(data);
        Some(Self::data_frame(id.into(), data.len() as u8, bytes))
    }

    fn new_remote(id: impl Into<Id>, dlc: usize) -> Option<Self> {
        (dlc <= 8).then(|| Self {
            remote: true,
            ..Self::data_frame(id.into(), dlc as u8, [0; 8])
        })
    }

    fn is_extended(&self) -> bool {
        matches!(self.id, Id::Extended(_))
    }

    fn is_remote_frame(&self) -> bool {
        self.remote
    }

    fn id(&self) -> Id {
        self.id
    }

    fn dlc(&self) -> usize {
        usize::from(self.length)
    }

    fn data(&self) -> &[u8] {
        let length = if self.remote { 0 } else { self.dlc() };
        self.bytes.get(..length).unwrap_or(&self.bytes)
    }
}

/// Identifier and data of a standard frame; a remote frame has no data. `None` for an extended
/// frame: the protocol has none.
#[inline(always)]
pub(super) fn standard<F: Frame>(frame: &F) -> Option<(StandardId, &[u8])> {
    let Id::Standard(id) = frame.id() else {
        return None;
    };
    let data: &[u8] = if frame.is_remote_frame() {
        &[]
    } else {
        frame.data()
    };
    Some((id, data))
}

/// A frame and when it was received.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StampedFrame {
    /// Receive time, us since any fixed moment.
    pub time_us: u64,
    /// The frame.
    pub frame: BusFrame,
}

#[cfg(test)]
mod tests {
    use super::*;

    const ID: StandardId = StandardId::MAX;

    impl BusFrame {
        /// The same frame with its bytes XOR `mask`; the most significant byte of `mask` falls on byte 0.
        pub(crate) fn flipped(&self, mask: u64) -> Self {
            let bytes = (u64::from_be_bytes(self.bytes) ^ mask).to_be_bytes();
            Self { bytes, ..*self }
        }
    }

    #[test]
    fn a_copy_keeps_identifier_length_and_bytes() {
        for length in 0..=8 {
            let data = &[1, 2, 3, 4, 5, 6, 7, 8][..length];
            let frame = BusFrame::new(ID, data).expect("up to eight bytes");
            assert_eq!(BusFrame::from_frame(&frame), frame);
            assert_eq!((frame.dlc(), frame.data()), (length, data));
        }
        assert_eq!(BusFrame::new(ID, &[0; 9]), None);
    }

    #[test]
    fn a_remote_frame_has_a_length_and_no_data() {
        let frame = BusFrame::new_remote(ID, 5).expect("up to eight");
        assert_eq!((frame.dlc(), frame.data().len()), (5, 0));
        assert!(frame.is_remote_frame());
        assert_eq!(BusFrame::new_remote(ID, 9), None);
    }
}
