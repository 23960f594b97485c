//! Who may move the pose, make it invalid, or reset: whoever knows the key of the stage.
//!
//! The tag is AES-CMAC (NIST SP 800-38B, RFC 4493) over whole blocks of 16 bytes: a domain, the
//! nonce, the blob padded with zeros, and a last block of four words: those of the command
//! ([`Command::payload`], number and token first), the blob's length in bytes, and its CRC-32C. A
//! command other than a commit has no blob, and two zeros; a commit that goes back has the CRC-32C of
//! the blob to go back to. Numbers are words of 32 bits, lowest byte first. The construction stands here, on the
//! block cipher of a library: over whole blocks it is a few lines, and they cannot panic. (The crate
//! `cmac` 0.8.0 can, as the linker shows at opt-level "s".)

use crate::can::command::Command;
use crate::can::e2e::Payload;
use aes::Aes128Enc;
use aes::cipher::{BlockCipherEncrypt, KeyInit};

/// A key of AES-128, one for each stage.
pub type Key = [u8; 16];

/// A number used once: random, drawn by the node for each tag.
pub type Nonce = [u32; 4];

/// Bytes of a tag: all that AES-CMAC gives.
pub const TAG_BYTES: usize = BLOCK;

/// Bytes of a block of AES.
pub(super) const BLOCK: usize = 16;

/// First block under every tag, so that a tag made with the same key for anything else is none of
/// these.
const DOMAIN: [u8; BLOCK] = *b"hall-requests-v2";

/// A tag that came, and the number that it must be over.
#[derive(Clone, Debug)]
pub(super) struct Tag {
    pub(super) nonce: Nonce,
    pub(super) bytes: [u8; TAG_BYTES],
}

impl Tag {
    /// Whether it is that of this command; `blob` and `crc` as in [`tag`]. Without a key any is.
    pub(super) fn is_of(
        &self,
        key: Option<&Key>,
        command: &Command,
        blob: &[u8],
        crc: u32,
    ) -> bool {
        let Some(key) = key else {
            return true;
        };
        let own = tag(key, &self.nonce, command, blob, crc);
        // In a time that does not depend on where they differ.
        u128::from_le_bytes(own) ^ u128::from_le_bytes(self.bytes) == 0
    }
}

fn encrypt(cipher: &Aes128Enc, block: u128) -> u128 {
    let mut bytes = block.to_le_bytes().into();
    cipher.encrypt_block(&mut bytes);
    u128::from_le_bytes(bytes.into())
}

const fn in_one_block([a, b, c, d]: [u32; 4]) -> u128 {
    (d as u128) << 96 | (c as u128) << 64 | (b as u128) << 32 | a as u128
}

/// AES-CMAC over whole blocks, of which the last comes by itself.
fn cmac(key: &Key, blocks: impl Iterator<Item = u128>, last: u128) -> [u8; TAG_BYTES] {
    let cipher = Aes128Enc::new(&(*key).into());
    let chain = blocks.fold(0, |chain, block| encrypt(&cipher, chain ^ block));
    // The subkey K1 is E(0) times x in GF(2^128), most significant bit first.
    let zero = encrypt(&cipher, 0).swap_bytes();
    let reduction = if zero >> 127 == 1 { 0x87 } else { 0 };
    let k1 = (zero << 1 ^ reduction).swap_bytes();
    encrypt(&cipher, chain ^ last ^ k1).to_le_bytes()
}

/// The tag that a host sends before a command. `blob` and `crc` are those of what a commit stores:
/// without a blob it goes back to the one of this CRC. For any other command both are empty.
pub fn tag(key: &Key, nonce: &Nonce, command: &Command, blob: &[u8], crc: u32) -> [u8; TAG_BYTES] {
    let head = [u128::from_le_bytes(DOMAIN), in_one_block(*nonce)];
    let padded = blob.chunks(BLOCK).map(|bytes| {
        let mut block = [0; BLOCK];
        for (to, from) in block.iter_mut().zip(bytes) {
            *to = *from;
        }
        u128::from_le_bytes(block)
    });
    let Payload { short, long } = command.payload();
    let bytes = u32::try_from(blob.len()).unwrap_or(u32::MAX);
    let last = in_one_block([short, long, bytes, crc]);
    cmac(key, head.into_iter().chain(padded), last)
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;
    use crate::can::command::Request;
    use crate::can::update::UpdateRequest;
    use cmac::{Cmac, Mac};

    const fn commit(sequence: u32) -> Command {
        Command::new(Request::Update(UpdateRequest::Commit { sequence }), 0xab)
    }

    #[test]
    fn it_is_that_of_another_implementation_for_any_length() {
        for bytes in 0..200_u32 {
            let key = [bytes as u8 ^ 0x5a; 16];
            let nonce = [bytes, 0x8000_0001, !bytes, 7];
            let blob: std::vec::Vec<u8> = (0..bytes).map(|k| (k * 37) as u8).collect();
            let mut padded = blob.clone();
            padded.resize(blob.len().next_multiple_of(BLOCK), 0);
            let mut other = Cmac::<aes::Aes128>::new(&key.into());
            other.update(b"hall-requests-v2");
            nonce
                .iter()
                .for_each(|word| other.update(&word.to_le_bytes()));
            other.update(&padded);
            // Commit is command 9; the token stands above the four bits of the number.
            for word in [0xab9, bytes + 1, bytes, !bytes] {
                other.update(&word.to_le_bytes());
            }
            let want: [u8; 16] = other.finalize().into_bytes().into();
            assert_eq!(tag(&key, &nonce, &commit(bytes + 1), &blob, !bytes), want);
        }
    }

    #[test]
    fn every_input_changes_the_tag_and_no_other_is_taken() {
        let (key, nonce, blob) = ([7; 16], [1, 2, 3, 4], [5; 100]);
        let want = tag(&key, &nonce, &commit(9), &blob, 6);
        let is_taken = |bytes| Tag { nonce, bytes }.is_of(Some(&key), &commit(9), &blob, 6);
        assert!(is_taken(want));
        for bit in 0..128 {
            let wrong = u128::from_le_bytes(want) ^ 1 << bit;
            assert!(!is_taken(wrong.to_le_bytes()));
        }
        assert_ne!(tag(&[8; 16], &nonce, &commit(9), &blob, 6), want);
        assert_ne!(tag(&key, &[1, 2, 3, 5], &commit(9), &blob, 6), want);
        assert_ne!(tag(&key, &nonce, &commit(10), &blob, 6), want);
        let (other_token, other_request) = (
            Command {
                token: 0xac,
                ..commit(9)
            },
            Command::new(Request::ServoOff { seconds: 9 }, 0xab),
        );
        assert_ne!(tag(&key, &nonce, &other_token, &blob, 6), want);
        assert_ne!(tag(&key, &nonce, &other_request, &blob, 6), want);
        assert_ne!(tag(&key, &nonce, &commit(9), &blob[..99], 6), want);
        assert_ne!(tag(&key, &nonce, &commit(9), &blob, 7), want);
        // Of equal blocks, too, the length is part of it.
        let of_zeros = |bytes| tag(&key, &nonce, &commit(9), &[0; 4][..bytes], 6);
        assert_ne!(of_zeros(3), of_zeros(4));
    }
}
