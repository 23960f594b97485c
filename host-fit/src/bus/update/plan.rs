//! What an update is to do, and what it did.

use super::identity::Identity;
use hal_adapters::can::update::Key;

/// What is to be done.
#[derive(Clone, Debug)]
pub struct Plan {
    /// The blob, which the caller has checked; empty to go back to the record before the newest.
    pub blob: Vec<u8>,
    /// Serial number of the stage that it belongs to; `None` for any.
    pub serial: Option<String>,
    /// The stage's key.
    pub key: Option<Key>,
    /// Declare the servo off for the time of the update.
    pub declares_servo_off: bool,
    /// Reset the node at the end, so that it runs the new parameters.
    pub activates: bool,
    /// Token of the first transfer; two programs need different ones.
    pub token: u8,
}

/// What was done.
#[derive(Clone, Debug, PartialEq)]
pub struct Updated {
    /// The node before.
    pub before: Identity,
    /// Sequence number of the record; `None`: the node ran these parameters already, and nothing
    /// was sent.
    pub sequence: Option<u32>,
    /// Whether the node has been reset and runs them.
    pub is_active: bool,
    /// Words that had to be sent again, and transfers that had to be begun anew.
    pub repeated: (u32, u32),
}
