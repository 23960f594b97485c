//! SPI1 by DMA2: a transfer is one go of the DMA controller, without a loop over its bytes, so that
//! it takes the time of its bits and nothing else (RM0090 rev. 18, sections 10 and 28.3.9).

use crate::board::CORE_HZ;
use cortex_m::asm;
use embedded_hal::spi::{ErrorKind, ErrorType, SpiBus};
use stm32f4xx_hal::pac::{DMA2, SPI1};
use stm32f4xx_hal::rcc::{Enable, Rcc, Reset};

/// Streams that serve SPI1 and their directions, the receiver first, and their channel (table 43).
const STREAMS: [(usize, u32); 2] = [(0, 0), (3, TO_PERIPHERAL)];
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

/// Bytes of a write at a time.
const CHUNK: usize = 32;

/// The bus. Its buffers must not lie in CCM RAM (section 2.3.1): DMA does not reach it.
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

    /// Sends each byte and receives a byte in its place.
    fn exchange(&mut self, words: &mut [u8]) -> Result<(), ErrorKind> {
        if words.is_empty() {
            return Ok(());
        }
        let count = u16::try_from(words.len()).map_err(|_| ErrorKind::Other)?;
        let address = words.as_mut_ptr() as u32;
        let (spi, dma) = (&self.spi, &self.dma);
        // Of an earlier transfer that was given up: a byte, and the overrun, which reads of both registers in this order
        // clear (RM0090 rev. 18, section 28.3.10). Until then no byte is received.
        let _ = spi.dr().read();
        let _ = spi.sr().read();
        spi.cr2().modify(|_, w| w.rxdmaen().set_bit());
        // SAFETY: bits that are cleared by writing 1.
        dma.lifcr().write(|w| unsafe { w.bits(ALL_FLAGS) });
        for (stream, direction) in STREAMS {
            let Some(registers) = dma.st_iter().nth(stream) else {
                return Err(ErrorKind::Other);
            };
            let settings = CHANNEL | FIRST | NEXT_ADDRESS | direction;
            // SAFETY: the data register of SPI1, and memory that the caller lends until this returns: no
            // stream is on any more then.
            unsafe {
                registers.ndtr().write(|w| w.ndt().set(count));
                registers.par().write(|w| w.bits(spi.dr().as_ptr() as u32));
                registers.m0ar().write(|w| w.bits(address));
                registers.cr().write(|w| w.bits(settings));
                // The bytes to be sent must be in memory before.
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
        // The received bytes are read afterwards.
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
        words.fill(0);
        self.exchange(words)
    }

    fn write(&mut self, words: &[u8]) -> Result<(), ErrorKind> {
        for words in words.chunks(CHUNK) {
            let mut buffer = [0; CHUNK];
            let buffer = buffer.get_mut(..words.len()).unwrap_or_default();
            buffer.copy_from_slice(words);
            self.exchange(buffer)?;
        }
        Ok(())
    }

    fn transfer(&mut self, read: &mut [u8], write: &[u8]) -> Result<(), ErrorKind> {
        let (both, rest) = read.split_at_mut(read.len().min(write.len()));
        let (sent, unanswered) = write.split_at(both.len());
        both.copy_from_slice(sent);
        self.exchange(both)?;
        self.read(rest)?;
        self.write(unanswered)
    }

    fn transfer_in_place(&mut self, words: &mut [u8]) -> Result<(), ErrorKind> {
        self.exchange(words)
    }

    /// A transfer ends with its last byte.
    fn flush(&mut self) -> Result<(), ErrorKind> {
        Ok(())
    }
}
