//! New parameters for a node over the bus, checked as a whole before anything is stored.
//!
//! ```text
//! host                               node
//! Tell {page}, ReadBack {k}   ->     who it is, what it runs
//! ServoOff {seconds}     (tag)->     the servo is off: Done
//! Begin {bytes, check}   (tag)->     a transfer is open, under the token of this command; the pose
//!                                    is invalid until it ends. Done {bytes, check}, ServoOn, Busy,
//!                                    BadContent (too long), NoParameters (nothing to go back to),
//!                                    WrongSequence (another blob to go back to)
//! UpdateData, any order       ->     kept in RAM
//! Commit {sequence}      (tag)->     Incomplete {first missing index}: send it and ask again;
//!                                    WrongSequence; Started. Then up to half a second without any
//!                                    frame, and Done {CRC}, NotAuthorised, BadContent, SupplyLow,
//!                                    StoreFailed, ServoOn
//! Activate               (tag)->     Done, and a reset: the newest blob runs
//! ```
//!
//! Where the node has a key, a request with a tag is sent like this; else alone.
//!
//! ```text
//! Challenge {0}               ->     a new nonce is drawn, the answer is its first word; NoRandomNumber
//! Challenge {1 to 3}          ->     its other words
//! UpdateData 240 to 243       ->     the tag, kept in RAM
//! the request                 ->     Incomplete {first missing index}: send it and ask again;
//!                                    NotAuthorised, if the tag is not that of this nonce and request
//! ```
//!
//! Every request may be repeated, with the same token: it is not done twice, and its answer comes
//! again (that of a tagged one until the next challenge). A transfer ends when it is committed, refused or aborted, when the servo is declared on,
//! and when nothing came for 5 s; until then another host gets Busy. A host sends at most one
//! frame in a millisecond: the store of a controller holds three frames, and is emptied every 2 ms.
//!
//! A transfer of length 0 has no words; its commit goes back to the blob before
//! the newest, if that is the one whose check it began with.
//!
//! Two hosts may choose the same token. So `Begin` names the low half of the blob's CRC-32C, and
//! opens no transfer while one of another blob is open; and `Done` names what was begun or stored.
//! Whoever lost the answer to a commit asks which blob is the newest ([`page::NEXT`]).
//!
//! Who may: where the node has a key, whoever sends the right tag ([`tag`]): AES-CMAC over
//! the nonce, the request with its token, and for a commit the blob. A nonce serves once, for a right
//! tag and for a wrong one: a recording is worth nothing, and each guess takes a challenge. All that
//! moves the pose, makes it invalid or resets needs a tag ([`Command::needs_authority`]). Where the
//! node has no key, whoever can send on the bus may, while the line says that the servo is off: the
//! check of a frame shows damage, not who sent it.
//!
//! [`Command::needs_authority`]: super::command::Command::needs_authority

mod authentication;
mod receiver;
mod request;
mod staging;
mod store;
mod tell;

pub use authentication::{Key, Nonce, TAG_BYTES, tag};
pub use receiver::{Receiver, Surroundings};
pub use request::{UpdateData, UpdateRequest};
pub use staging::{TAG_INDEX, crc_of, word_of};
pub use store::{Change, Kept, NotWritten, Running, Store};
pub use tell::{Identity, page};
