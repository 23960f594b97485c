//! SPI1 by DMA2: a transfer is one go of the DMA controller, without a loop over its bytes, so that
//! it takes the time of its bits and nothing else (RM0090 rev. 18, sections 10 and 28.3.9).

use crate::board::CORE_HZ;
use cortex_m::asm;
use embedded_hal::spi::{ErrorKind, ErrorType, SpiBus};
use stm32f4xx_hal::pac::{DMA2, SPI1};
use stm32f4xx_hal::rcc::{Enable, Rcc, Reset};

/// Streams that serve SPI1, and the channel on which they do (table 43).
const RECEIVE: usize = 0;
const SEND: usize = 3;
const CHANNEL: u32 = 3 << 25;
/// Bits of DMA_SxCR (section 10.5.5): enable, from memory to the peripheral, one address after the
/// other in memory, highest priority. Units are bytes.
const ENABLE: u32 = 1;
const TO_PERIPHERAL: u32 = 0b01 << 6;
const NEXT_ADDRESS: u32 = 1 << 10;
const FIRST: u32 = 0b11 << 16;
/// Bits of DMA_LISR: transfer complete of stream 0; transfer errors of streams 0 and 3.
const RECEIVED: u32 = 1 << 5;
const ERRORS: u32 = 1 << 3 | 1 << 25;
/// Bits of DMA_LIFCR: all of stream 0, and all of stream 3.
const ALL_FLAGS: u32 = 0b11_1101 | 0b11_1101 << 22;
/// Looks until a transfer is given up. A look takes four cycles at least: 0.5 ms or more, where a
/// transfer of 30 bytes takes 23 us.
const LOOKS: u32 = CORE_HZ / 4 / 2000;

/// The bus, whose buffers must not lie in CCM RAM (section 2.3.1): DMA does not reach it.
pub struct SpiDma {
    spi: SPI1,
    dma: DMA2,
}

impl SpiDma {
    /// Takes over a bus that is set up and switched on.
    pub fn new(spi: SPI1, dma: DMA2, rcc: &mut Rcc) -> Self {
        DMA2::enable(rcc);
        Self { spi, dma }
    }

    /// Sends and receives `count` bytes. Each side is so many bytes, or, if it does not move, one that
    /// stands for all. Both may be the same: a byte is sent before one is received in its place.
    fn exchange(
        &mut self,
        (from, from_moves): (*const u8, u32),
        (into, into_moves): (*mut u8, u32),
        count: usize,
    ) -> Result<(), ErrorKind> {
        if count == 0 {
            return Ok(());
        }
        let count = u16::try_from(count).map_err(|_| ErrorKind::Other)?;
        let (spi, dma) = (&self.spi, &self.dma);
        // What an earlier transfer may have left, if it was given up.
        let _ = spi.dr().read();
        spi.cr2().modify(|_, w| w.rxdmaen().set_bit());
        // SAFETY: bits that are cleared by writing 1.
        dma.lifcr().write(|w| unsafe { w.bits(ALL_FLAGS) });
        let (received, sent) = (into as u32, from as u32);
        for (stream, address, settings) in [
            (RECEIVE, received, into_moves),
            (SEND, sent, from_moves | TO_PERIPHERAL),
        ] {
            let registers = dma.st(stream);
            let settings = CHANNEL | FIRST | settings;
            // SAFETY: the data register of SPI1, and memory of `count` bytes that the caller lends
            // until this returns: no stream is on any more then.
            unsafe {
                registers.ndtr().write(|w| w.ndt().set(count));
                registers.par().write(|w| w.bits(spi.dr().as_ptr() as u32));
                registers.m0ar().write(|w| w.bits(address));
                registers.cr().write(|w| w.bits(settings));
                // What is sent must be in memory before.
                asm::dmb();
                registers.cr().write(|w| w.bits(settings | ENABLE));
            }
        }
        spi.cr2().modify(|_, w| w.txdmaen().set_bit());
        let mut flags = 0;
        for _ in 0..LOOKS {
            flags = dma.lisr().read().bits();
            if flags & (RECEIVED | ERRORS) != 0 {
                break;
            }
        }
        spi.cr2()
            .modify(|_, w| w.rxdmaen().clear_bit().txdmaen().clear_bit());
        // What was received is read afterwards.
        asm::dmb();
        if flags & (RECEIVED | ERRORS) == RECEIVED {
            return Ok(());
        }
        // SAFETY: nothing else uses DMA2. After its reset no stream writes to the caller's memory.
        unsafe { DMA2::reset_unchecked() };
        Err(ErrorKind::Other)
    }
}

impl ErrorType for SpiDma {
    type Error = ErrorKind;
}

impl SpiBus for SpiDma {
    fn read(&mut self, words: &mut [u8]) -> Result<(), ErrorKind> {
        let into = (words.as_mut_ptr(), NEXT_ADDRESS);
        let zero = 0;
        self.exchange((&raw const zero, 0), into, words.len())
    }

    fn write(&mut self, words: &[u8]) -> Result<(), ErrorKind> {
        let from = (words.as_ptr(), NEXT_ADDRESS);
        let mut nowhere = 0;
        self.exchange(from, (&raw mut nowhere, 0), words.len())
    }

    fn transfer(&mut self, read: &mut [u8], write: &[u8]) -> Result<(), ErrorKind> {
        let both = read.len().min(write.len());
        let (both_ways, read) = read.split_at_mut(both);
        let (sent, write) = write.split_at(both);
        both_ways.copy_from_slice(sent);
        self.transfer_in_place(both_ways)?;
        self.read(read)?;
        self.write(write)
    }

    fn transfer_in_place(&mut self, words: &mut [u8]) -> Result<(), ErrorKind> {
        let into = words.as_mut_ptr();
        let from = (into.cast_const(), NEXT_ADDRESS);
        self.exchange(from, (into, NEXT_ADDRESS), words.len())
    }

    /// Nothing is left to send when a transfer has ended.
    fn flush(&mut self) -> Result<(), ErrorKind> {
        Ok(())
    }
}
