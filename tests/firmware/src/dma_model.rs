//! DMA2 of an STM32F405 (RM0090 rev. 18, section 10) where it serves SPI1: bytes between memory and
//! the data register, in direct mode.

use crate::image::{RAM, RAM_BYTES};
use std::ops::Range;

/// Address of the data register of SPI1.
const SPI1_DR: u32 = 0x4001_300c;
/// Registers of a stream, and from one stream's to the next one's (section 10.5.11).
const STREAMS: usize = 0x10;
const STRIDE: usize = 0x18;
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

#[derive(Clone, Copy, Default)]
struct Stream {
    control: u32,
    count: u32,
    peripheral: u32,
    memory: u32,
}

/// Streams and their flags, LISR below HISR.
#[derive(Default)]
pub struct Dma {
    streams: [Stream; 8],
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
            STREAMS.. => {
                let stream = &self.streams[(offset - STREAMS) / STRIDE];
                match (offset - STREAMS) % STRIDE {
                    0x0 => stream.control,
                    0x4 => stream.count,
                    0x8 => stream.peripheral,
                    0xc => stream.memory,
                    _ => 0,
                }
            }
            _ => 0,
        }
    }

    /// Writes a register. The registers of a running stream are protected.
    pub fn write(&mut self, offset: usize, value: u32) {
        match offset {
            0x8 => self.flags &= !u64::from(value),
            0xc => self.flags &= !(u64::from(value) << 32),
            STREAMS.. => {
                let k = (offset - STREAMS) / STRIDE;
                let flags = self.flags >> shift(k) & ALL;
                let stream = &mut self.streams[k];
                let is_on = stream.control & ENABLE != 0;
                match (offset - STREAMS) % STRIDE {
                    // Flags of an earlier transfer must be cleared before (section 10.3.17).
                    0x0 if is_on => stream.control &= !ENABLE | value & ENABLE,
                    0x0 if flags == 0 => stream.control = value,
                    0x0 => stream.control = value & !ENABLE,
                    0x4 if !is_on => stream.count = value & 0xffff,
                    0x8 if !is_on => stream.peripheral = value,
                    0xc if !is_on => stream.memory = value,
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
        let (k, stream) = self.streams.iter_mut().enumerate().find(|(k, stream)| {
            stream.control & ENABLE != 0
                && listens_to(*k, stream.control >> 25 & 7) == Some(request)
        })?;
        let count = stream.count as usize;
        let bytes = match stream.control & NEXT_ADDRESS {
            0 => 1,
            _ => count,
        };
        let at = stream.memory.wrapping_sub(RAM) as usize;
        let is_sound = stream.control & NOT_MODELLED == 0
            && stream.control >> 6 & 3 == direction
            && stream.peripheral == SPI1_DR
            && count > 0
            && at.saturating_add(bytes) <= RAM_BYTES;
        if !is_sound {
            stream.control &= !ENABLE;
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
        let stream = &mut self.streams[side.stream];
        stream.count -= bytes as u32;
        if stream.count == 0 {
            stream.control &= !ENABLE;
            self.flags |= COMPLETE << shift(side.stream);
        }
    }
}
