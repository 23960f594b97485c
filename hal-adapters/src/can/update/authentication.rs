//! Authority: whoever knows the key of the stage may move the pose, invalidate it, or reset the node.
//!
//! The tag is AES-CMAC (NIST SP 800-38B, RFC 4493) over whole blocks of 16 bytes: a domain with the node's number, the
//! nonce, the blob padded with zeros, and a last block of four words. These are the two words of the command
//! ([`Command::payload`], number and token first), the length of the blob in bytes, and its CRC-32C; the last
//! two are zero for a command without a blob. Words have 32 bits, lowest byte first.

use super::staging::blob_crc;
use super::tell::Identity;
use crate::can::NodeNumber;
use crate::can::command::Command;
use crate::can::e2e::Payload;
use aes::Aes128Enc;
use cmac::{Cmac, KeyInit, Mac};

/// A key of AES-128, one for each stage.
pub type Key = [u8; 16];

/// A number used once: the node draws it at random for each tag.
pub type Nonce = [u32; 4];

/// Bytes of a tag: the whole output of AES-CMAC.
pub const TAG_BYTES: usize = BLOCK;

/// Bytes of a block of AES.
const BLOCK: usize = 16;

/// The first words under every tag; the fourth is the node's number. So a tag that the same key made for another purpose
/// or another node is not accepted.
const DOMAIN: [u32; 3] = [0x6c6c_6168, 0x6761_742d, 0x0033_762d];
/// Bytes of the stack below a tag: there the cipher has its round keys, which give the key.
const WIPED_BYTES: usize = 1536;

/// A tag from a host, and the nonce that it must answer.
#[derive(Clone, Debug)]
pub(super) struct Tag {
    pub(super) nonce: Nonce,
    pub(super) bytes: [u8; TAG_BYTES],
}

impl Tag {
    /// Whether this is the tag of a command and its blob. Without a key every tag is.
    pub(super) fn matches(&self, identity: &Identity<'_>, command: &Command, blob: &[u8]) -> bool {
        let Some(key) = identity.key else {
            return true;
        };
        let own = tag(key, identity.node, &self.nonce, command, blob);
        // In constant time.
        u128::from_le_bytes(own) ^ u128::from_le_bytes(self.bytes) == 0
    }
}

const fn in_one_block([a, b, c, d]: [u32; 4]) -> u128 {
    (d as u128) << 96 | (c as u128) << 64 | (b as u128) << 32 | a as u128
}

/// The tag of a command to a node. `blob` is the blob of a commit, and empty for any other command. Leaves nothing of the
/// key on the stack.
pub fn tag(
    key: &Key,
    node: NodeNumber,
    nonce: &Nonce,
    command: &Command,
    blob: &[u8],
) -> [u8; TAG_BYTES] {
    let [d0, d1, d2] = DOMAIN;
    let head = [[d0, d1, d2, node.number()], *nonce].map(in_one_block);
    let padded = blob.chunks(BLOCK).map(|bytes| {
        let mut block = [0; BLOCK];
        for (to, from) in block.iter_mut().zip(bytes) {
            *to = *from;
        }
        u128::from_le_bytes(block)
    });
    let Payload { short, long } = command.payload();
    let bytes = u32::try_from(blob.len()).unwrap_or(u32::MAX);
    let last = in_one_block([short, long, bytes, blob_crc(blob).unwrap_or(0)]);
    let tag = cmac(key, head.into_iter().chain(padded).chain([last]));
    wipe_stack();
    tag
}

/// AES-CMAC over blocks.
#[inline(never)]
fn cmac(key: &Key, blocks: impl Iterator<Item = u128>) -> [u8; TAG_BYTES] {
    let mut mac = <Cmac<Aes128Enc> as KeyInit>::new(key.into());
    blocks.for_each(|block| mac.update(&block.to_le_bytes()));
    mac.finalize().into_bytes().into()
}

/// Overwrites the stack that the function called before has used.
#[inline(never)]
fn wipe_stack() {
    core::hint::black_box(&mut [0u8; WIPED_BYTES]);
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;
    use crate::can::command::Request;
    use crate::can::update::UpdateRequest;

    const fn commit(sequence: u32) -> Command {
        Command::new(Request::Update(UpdateRequest::Commit { sequence }), 0xab)
    }

    #[test]
    fn the_tag_is_the_cmac_of_the_described_bytes_for_any_length() {
        for bytes in 0..200_u32 {
            let key = [bytes as u8 ^ 0x5a; 16];
            let nonce = [bytes, 0x8000_0001, !bytes, 7];
            let blob: std::vec::Vec<u8> = (0..bytes).map(|k| (k * 37) as u8).collect();
            let mut padded = blob.clone();
            padded.resize(blob.len().next_multiple_of(BLOCK), 0);
            let node = NodeNumber::new(bytes).expect("a node");
            let mut other = Cmac::<aes::Aes128>::new(&key.into());
            other.update(b"hall-tag-v3\0");
            other.update(&bytes.to_le_bytes());
            nonce
                .iter()
                .for_each(|word| other.update(&word.to_le_bytes()));
            other.update(&padded);
            // Commit is command 9; the token stands above the four bits of the number.
            let crc = blob_crc(&blob).unwrap_or(0);
            for word in [0xab9, bytes + 1, bytes, crc] {
                other.update(&word.to_le_bytes());
            }
            let want: [u8; 16] = other.finalize().into_bytes().into();
            assert_eq!(tag(&key, node, &nonce, &commit(bytes + 1), &blob), want);
        }
    }

    #[test]
    fn an_example_of_rfc_4493_gives_its_tag() {
        let key = 0x2b7e_1516_28ae_d2a6_abf7_1588_09cf_4f3c_u128.to_be_bytes();
        let block = 0x6bc1_bee2_2e40_9f96_e93d_7e11_7393_172a_u128.swap_bytes();
        let want = 0x070a_16b4_6b4d_4144_f79b_dd9d_d04a_287c_u128.to_be_bytes();
        assert_eq!(cmac(&key, [block].into_iter()), want);
    }

    #[test]
    fn no_flipped_bit_of_a_tag_is_accepted() {
        let (nonce, blob) = ([1, 2, 3, 4], [5; 100]);
        let node = NodeNumber::new(5).expect("a node");
        let identity = Identity {
            key: Some(&[7; 16]),
            node,
            ..Identity::default()
        };
        let want = tag(&[7; 16], node, &nonce, &commit(9), &blob);
        let is_accepted = |bytes| Tag { nonce, bytes }.matches(&identity, &commit(9), &blob);
        assert!(is_accepted(want));
        // The tag of a request to another node of the same key.
        let other = tag(&[7; 16], NodeNumber::TABLE, &nonce, &commit(9), &blob);
        assert!(!is_accepted(other));
        for bit in 0..128 {
            let wrong = u128::from_le_bytes(want) ^ 1 << bit;
            assert!(!is_accepted(wrong.to_le_bytes()));
        }
    }
}
