//! Requests about the parameters, and the frames that carry a blob.

use super::super::e2e::Payload;

/// A request about the parameters: commands 6 to 14.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum UpdateRequest {
    /// Asks for a word of the nonce: the detail of the answer.
    Challenge {
        /// Which word, 0 to 3; word 0 draws a new nonce.
        part: u8,
    },
    /// Opens a transfer under the token of this command.
    Begin {
        /// Length of the blob, 1 to [`runtime::blob::MAX_BYTES`].
        bytes: u16,
    },
    /// Checks the transferred blob and stores it.
    Commit {
        /// Its sequence number: one above the highest in the store.
        sequence: u32,
    },
    /// Closes the transfer; nothing is stored.
    Abort,
    /// Resets the node, which then runs the newest blob. Acknowledges that the node stopped.
    Activate,
    /// Asks for a word of the blob that runs: the detail of the answer.
    ReadBack {
        /// Which word, from 0; the last one is padded with zeros.
        index: u8,
    },
    /// Asks for a fact of the node: the detail of the answer.
    Tell {
        /// Which fact; see [`super::page`].
        page: u8,
    },
}

impl UpdateRequest {
    /// Number of the command and its argument in the frame.
    pub const fn in_frame(self) -> (u8, u32) {
        match self {
            Self::Challenge { part } => (6, part as u32),
            Self::Begin { bytes } => (7, bytes as u32),
            Self::Commit { sequence } => (9, sequence),
            Self::Abort => (10, 0),
            Self::Activate => (11, 0),
            Self::ReadBack { index } => (13, index as u32),
            Self::Tell { page } => (14, page as u32),
        }
    }

    /// From number and argument of a frame.
    pub fn from_frame(number: u8, argument: u32) -> Option<Self> {
        let byte = u8::try_from(argument).ok();
        match (number, argument) {
            (6, 0..4) => byte.map(|part| Self::Challenge { part }),
            (7, _) => u16::try_from(argument)
                .ok()
                .map(|bytes| Self::Begin { bytes }),
            (9, sequence) => Some(Self::Commit { sequence }),
            (10, 0) => Some(Self::Abort),
            (11, 0) => Some(Self::Activate),
            (13, _) => byte.map(|index| Self::ReadBack { index }),
            (14, _) => byte.map(|page| Self::Tell { page }),
            _ => None,
        }
    }
}

/// A frame of [`super::super::Message::UpdateData`]: one word of a transfer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct UpdateData {
    /// Token of the transfer.
    pub token: u8,
    /// Which word: of the blob from 0, of the tag from [`super::TAG_INDEX`].
    pub index: u8,
    /// Four bytes, lowest first.
    pub word: u32,
}

impl UpdateData {
    /// The 52 bits of the frame.
    pub const fn payload(&self) -> Payload {
        Payload::new((self.index as u32) << 8 | self.token as u32, self.word)
    }

    /// From the 52 bits of a frame.
    pub const fn from_payload(p: Payload) -> Self {
        Self {
            token: p.short as u8,
            index: (p.short >> 8) as u8,
            word: p.long,
        }
    }
}
