//! New parameters for a node over the bus, checked as a whole before anything is stored.
//!
//! ```text
//! host                               node
//! ServoOff {seconds}          ->     the servo is off: Done
//! Tell {page}, ReadBack {k}   ->     who it is, what it runs
//! Begin {bytes, check}        ->     a transfer is open, under the token of this command; the pose
//!                                    is invalid until it ends. Done {bytes, check}, ServoOn, Busy,
//!                                    BadContent (too long), NoParameters (nothing to go back to),
//!                                    WrongSequence (another blob to go back to), NoRandomNumber
//! Challenge {0 to 3}          ->     the nonce of this transfer
//! UpdateData, any order       ->     kept in RAM; the tag from index 240, where the node has a key
//! Commit {sequence}           ->     Incomplete {first missing index}: send it and ask again;
//!                                    WrongSequence; Started. Then up to half a second without any
//!                                    frame, and Done {CRC}, NotAuthorised, BadContent, SupplyLow,
//!                                    StoreFailed, ServoOn
//! Activate                    ->     Done, and a reset: the newest blob runs
//! ```
//!
//! Every request may be repeated, with the same token: it is not done twice, and its answer comes
//! again. A transfer ends when it is committed, refused or aborted, when the servo is declared on,
//! and when nothing came for 5 s; until then another host is told Busy. A host sends at most one
//! frame in a millisecond: the store of a controller holds three frames, and is emptied every 2 ms.
//!
//! A transfer of length 0 has no words but those of the tag; its commit goes back to the blob before
//! the newest, if that is the one whose check it began with.
//!
//! Two hosts may choose the same token. So `Begin` names the low half of the blob's CRC-32C, and
//! opens no transfer while one of another blob is open; and `Done` names what was begun or stored.
//! Whoever lost the answer to a commit asks which blob is the newest ([`page::NEXT`]).
//!
//! Who may: where the node has a key, whoever sends the right tag ([`Authenticator`]): AES-CMAC over
//! the transfer's nonce, the blob, the sequence number, the length and the CRC-32C. A nonce is drawn for each
//! transfer, and a transfer ends with its first wrong tag: a recording of an update is worth nothing,
//! and each guess takes a transfer. Where the node has no key, whoever can send on the bus may:
//! the check of a frame shows damage, not who sent it. What stores nothing needs no key: whoever can
//! send can declare the servo off, keep a transfer open and reset the node, but not change its
//! parameters.

mod authentication;
mod receiver;
mod request;
mod staging;
mod store;
mod tell;

pub use authentication::{Authenticator, Key, Nonce, TAG_BYTES, tag};
pub use receiver::{Receiver, Surroundings};
pub use request::{UpdateData, UpdateRequest};
pub use staging::{TAG_INDEX, crc_of, word_of};
pub use store::{Change, Kept, NotWritten, Running, Store};
pub use tell::{Identity, page};
