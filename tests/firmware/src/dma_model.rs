//! DMA2 of an STM32F405 (RM0090 rev. 18, section 10) where it serves SPI1: bytes between memory and
//! the data register, in direct mode.

use crate::image::{RAM, RAM_BYTES};
use std::ops::Range;

/// Address of the data register of SPI1.
const SPI1_DR: u32 = 0x4001_300c;
/// Registers of a stream, and from one stream's to the next one's (section 10.5.11).
const STREAMS: usize = 0x10;
const STRIDE: usize = 0x18;
/// Words of a stream: DMA_SxCR, DMA_SxNDTR, DMA_SxPAR, DMA_SxM0AR; two are not modelled.
const WORDS: usize = STRIDE / 4;
/// Bits of DMA_SxCR (section 10.5.5).
const ENABLE: u32 = 1;
const NEXT_ADDRESS: u32 = 1 << 10;
/// Circular, next address of the peripheral, units that are not bytes, two buffers, bursts.
const NOT_MODELLED: u32 = 1 << 8 | 1 << 9 | 0b1111 << 11 | 1 << 18 | 0b1111 << 21;
/// Flags of a stream (section 10.5.1): transfer error, transfer complete, and all.
const ERROR: u64 = 1 << 3;
const COMPLETE: u64 = 1 << 5;
const ALL: u64 = 0b11_1101;

/// What asks for a transfer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Request {
    /// A byte has come.
    Spi1Rx,
    /// A byte may be sent.
    Spi1Tx,
}

/// Table 43: what a channel of a stream listens to.
const fn listens_to(stream: usize, channel: u32) -> Option<Request> {
    match (channel, stream) {
        (3, 0 | 2) => Some(Request::Spi1Rx),
        (3, 3 | 5) => Some(Request::Spi1Tx),
        _ => None,
    }
}

/// Streams and their flags, LISR below HISR.
#[derive(Default)]
pub struct Dma {
    streams: [[u32; WORDS]; 8],
    flags: u64,
}

/// One side of a transfer: a stream, and where its bytes are in RAM.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Side {
    stream: usize,
    /// Bytes to transfer.
    pub count: usize,
    at: Range<usize>,
}

impl Side {
    /// Where the k-th byte is, from the start of RAM.
    pub fn at(&self, k: usize) -> usize {
        self.at.start + k.min(self.at.len() - 1)
    }
}

/// Place of the flags of each stream in the register of four streams.
const fn shift(stream: usize) -> usize {
    [0, 6, 16, 22, 32, 38, 48, 54][stream]
}

impl Dma {
    /// A register, by its distance from the first.
    pub fn read(&self, offset: usize) -> u32 {
        match offset {
            0x0 => self.flags as u32,
            0x4 => (self.flags >> 32) as u32,
            STREAMS.. => self.streams.as_flattened()[(offset - STREAMS) / 4],
            _ => 0,
        }
    }

    /// Writes a register. The registers of a running stream are protected.
    pub fn write(&mut self, offset: usize, value: u32) {
        match offset {
            0x8 => self.flags &= !u64::from(value),
            0xc => self.flags &= !(u64::from(value) << 32),
            STREAMS.. => {
                let (k, word) = ((offset - STREAMS) / STRIDE, (offset - STREAMS) % STRIDE / 4);
                let flags = self.flags >> shift(k) & ALL;
                let stream = &mut self.streams[k];
                match (word, stream[0] & ENABLE) {
                    // Flags of an earlier transfer must be cleared before (section 10.3.17).
                    (0, 0) if flags != 0 => stream[0] = value & !ENABLE,
                    (0, ENABLE) => stream[0] &= !ENABLE | value & ENABLE,
                    (_, 0) => stream[word] = value,
                    _ => {}
                }
            }
            _ => {}
        }
    }

    /// The stream that serves a request. One that cannot reach its memory, which is all but the main
    /// RAM, ends with an error.
    pub fn serves(&mut self, request: Request) -> Option<Side> {
        let direction = u32::from(request == Request::Spi1Tx);
        let (k, stream) = self
            .streams
            .iter_mut()
            .enumerate()
            .find(|(k, [control, ..])| {
                control & ENABLE != 0 && listens_to(*k, control >> 25 & 7) == Some(request)
            })?;
        let [control, count, peripheral, memory, ..] = *stream;
        let count = (count & 0xffff) as usize;
        let bytes = if control & NEXT_ADDRESS == 0 {
            1
        } else {
            count
        };
        let at = memory.wrapping_sub(RAM) as usize;
        let is_sound = control & NOT_MODELLED == 0
            && control >> 6 & 3 == direction
            && peripheral == SPI1_DR
            && count > 0
            && at.saturating_add(bytes) <= RAM_BYTES;
        if !is_sound {
            stream[0] &= !ENABLE;
            self.flags |= ERROR << shift(k);
            return None;
        }
        let at = at..at + bytes;
        Some(Side {
            stream: k,
            count,
            at,
        })
    }

    /// So many bytes of it are through: one that has transferred all is off.
    pub fn transferred(&mut self, side: &Side, bytes: usize) {
        let [control, count, ..] = &mut self.streams[side.stream];
        *count -= bytes as u32;
        if *count == 0 {
            *control &= !ENABLE;
            self.flags |= COMPLETE << shift(side.stream);
        }
    }
}
