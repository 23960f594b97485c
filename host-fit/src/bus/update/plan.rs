//! What an update is to do, and what it did.

use super::identity::Identity;
use hal_adapters::can::update::Key;
use runtime::ParameterSet;

/// What a node is to run, from its activation or power-on on.
#[derive(Clone, Debug, PartialEq)]
pub enum Wanted {
    /// This blob, which the caller has checked.
    Blob(Vec<u8>),
    /// What was stored before the newest.
    Previous,
    /// What it keeps already.
    Newest,
}

impl Wanted {
    /// The bytes to be sent.
    pub(super) fn blob(&self) -> &[u8] {
        match self {
            Self::Blob(blob) => blob,
            Self::Previous | Self::Newest => &[],
        }
    }

    /// Serial number of the stage that the blob belongs to, if it tells any.
    pub(super) fn serial(&self) -> Option<String> {
        let set = ParameterSet::from_bytes(self.blob()).ok()?;
        Some(set.serial.to_string()).filter(|serial| !serial.is_empty())
    }
}

/// What is to be done.
#[derive(Clone, Debug)]
pub struct Plan {
    /// What the node is to run.
    pub wanted: Wanted,
    /// Serial number that the node must tell; `None`: that of the blob, if both tell one.
    pub serial: Option<String>,
    /// The stage's key.
    pub key: Option<Key>,
    /// Declare the servo off for the time of the update.
    pub declares_servo_off: bool,
    /// Reset the node at the end, so that it runs the new parameters.
    pub activates: bool,
}

/// What was done.
#[derive(Clone, Debug, PartialEq)]
pub struct Updated {
    /// The node before.
    pub before: Identity,
    /// Sequence number of what was wanted.
    pub record: u32,
    /// The same, if this update stored it; `None`: the node kept it already.
    pub sequence: Option<u32>,
    /// Whether the node runs it.
    pub is_active: bool,
    /// Words that had to be sent again, and transfers that had to be begun anew.
    pub repeated: (u32, u32),
}
