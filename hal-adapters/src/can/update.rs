//! New parameters for a node over the bus. The node checks a blob as a whole before it stores
//! anything.
//!
//! ```text
//! host                               node
//! Tell {page}, ReadBack {k}   ->     who it is, the blob that runs
//! ServoOff {seconds}     (tag)->     Done: the servo is declared off
//! Begin {bytes}          (tag)->     Done: a transfer is open under this command's token, and the pose
//!                                    is invalid until it ends. ServoOn, Busy, BadContent (wrong length)
//! UpdateData, any order       ->     kept in RAM
//! Commit {sequence}      (tag)->     Incomplete {first missing index}: send that word and ask again;
//!                                    WrongSequence; Started. Then up to half a second without any
//!                                    frame, and Done {CRC}, NotAuthorised, BadContent, SupplyLow,
//!                                    StoreFailed, ServoOn
//! Activate               (tag)->     Done, and a reset: the newest blob runs
//! ```
//!
//! A node with a key obeys a request marked (tag) only after its tag:
//!
//! ```text
//! Challenge {0}               ->     a new nonce is drawn; the answer is its first word. NoRandomNumber
//! Challenge {1 to 3}          ->     its other words
//! UpdateData 240 to 243       ->     the tag, kept in RAM
//! the request                 ->     Incomplete {first missing index}: send that word and ask again;
//!                                    NotAuthorised: the tag is not the one of this nonce and request
//! ```
//!
//! A host may repeat every request with the same token. The node does it once and gives its answer again
//! (to a tagged request until the next challenge). A transfer ends when it is committed, refused or
//! aborted, when the servo is declared on, and after 5 s without a frame. Until then a host with another
//! token gets Busy. A host sends at most one frame in a millisecond: a controller stores three frames and
//! reads them every 2 ms.
//!
//! `Done` of a commit names the stored blob. A host that lost this answer asks which blob is the newest
//! ([`page::NEXT_CRC`]). To go back, a host reads the blob back before the update, and sends it again.
//!
//! **Authority.** The tag ([`tag`]) is AES-CMAC over the node's number, the nonce, the request with its token, and for a
//! commit the blob. One nonce serves for one tag, right or wrong, for 5 s: a recorded or delayed tag is worth nothing, and
//! each guess takes a challenge. All requests that move the pose, invalidate it or reset the node need a tag
//! ([`Command::needs_authority`]). Without a key any host on the bus may send them while the line says that
//! the servo is off: the check of a frame shows damage, not the sender.
//!
//! [`Command::needs_authority`]: super::command::Command::needs_authority

#[cfg(feature = "update")]
mod authentication;
#[cfg(feature = "update")]
mod receiver;
mod request;
#[cfg(feature = "update")]
mod staging;
#[cfg(feature = "update")]
mod store;
#[cfg(feature = "update")]
mod tell;
#[cfg(feature = "update")]
mod updates;

#[cfg(feature = "update")]
pub use authentication::{Key, Nonce, TAG_BYTES, tag};
#[cfg(feature = "update")]
pub use receiver::Receiver;
pub use request::{UpdateData, UpdateRequest};
#[cfg(feature = "update")]
pub use staging::{TAG_INDEX, blob_crc, word_at};
#[cfg(feature = "update")]
pub use store::{BlobId, NotWritten, Running, Store};
#[cfg(feature = "update")]
pub use tell::{Identity, page};
#[cfg(feature = "update")]
pub use updates::Updates;
