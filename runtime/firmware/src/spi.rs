//! SPI1 by DMA2: a transfer is one go of the DMA controller, without a loop over its bytes, so that
//! it takes the time of its bits and nothing else (RM0090 rev. 18, sections 10 and 28.3.9).

use crate::board::CORE_HZ;
use cortex_m::asm;
use embedded_hal::spi::{ErrorKind, ErrorType, SpiBus};
use stm32f4xx_hal::ReadFlags;
use stm32f4xx_hal::dma::DmaDirection::{self, MemoryToPeripheral, PeripheralToMemory};
use stm32f4xx_hal::dma::config::Priority;
use stm32f4xx_hal::dma::traits::{Stream, StreamISR};
use stm32f4xx_hal::dma::{DmaChannel, DmaFlag, Stream0, Stream3, StreamsTuple};
use stm32f4xx_hal::pac::{DMA2, SPI1};
use stm32f4xx_hal::rcc::{Rcc, Reset};

/// Looks until a transfer is given up. A look takes four cycles at least: 0.5 ms or more, where a
/// transfer of 30 bytes takes 23 us.
const LOOKS: u32 = CORE_HZ / 4 / 2000;
/// Bytes of a write at a time.
const CHUNK: usize = 32;

/// The bus. Its buffers must not lie in CCM RAM (section 2.3.1): DMA does not reach it.
pub struct SpiDma {
    spi: SPI1,
    receives: Stream0<DMA2>,
    sends: Stream3<DMA2>,
}

/// Starts a stream of bytes between the data register and `words`, which the caller lends until it has ended.
fn start(stream: &mut impl Stream, direction: DmaDirection, spi: &SPI1, words: &mut [u8]) {
    stream.clear_all_flags();
    // Streams 0 and 3 serve SPI1 on this channel (table 43).
    stream.set_channel(DmaChannel::Channel3);
    stream.set_direction(direction);
    stream.set_priority(Priority::VeryHigh);
    stream.set_memory_increment(true);
    stream.set_peripheral_address(spi.dr().as_ptr() as u32);
    stream.set_memory_address(words.as_mut_ptr() as u32);
    stream.set_number_of_transfers(words.len() as u16);
    // The bytes to be sent must be in memory before.
    asm::dmb();
    // SAFETY: all registers are set; the stream is off.
    unsafe { stream.enable() };
}

impl SpiDma {
    /// Takes over a bus that is set up and switched on.
    pub fn new(spi: SPI1, dma: DMA2, rcc: &mut Rcc) -> Self {
        let StreamsTuple(receives, _, _, sends, ..) = StreamsTuple::new(dma, rcc);
        Self {
            spi,
            receives,
            sends,
        }
    }

    /// Sends each byte and receives a byte in its place.
    fn exchange(&mut self, words: &mut [u8]) -> Result<(), ErrorKind> {
        match words.len() {
            0 => return Ok(()),
            1..0x1_0000 => {}
            _ => return Err(ErrorKind::Other),
        }
        let (spi, receives, sends) = (&self.spi, &mut self.receives, &mut self.sends);
        // Of an earlier transfer that was given up: a byte, and the overrun, which reads of both registers in this order
        // clear (RM0090 rev. 18, section 28.3.10). Until then no byte is received.
        let _ = spi.dr().read();
        let _ = spi.sr().read();
        spi.cr2().modify(|_, w| w.rxdmaen().set_bit());
        start(receives, PeripheralToMemory, spi, words);
        start(sends, MemoryToPeripheral, spi, words);
        spi.cr2().modify(|_, w| w.txdmaen().set_bit());
        let ended = DmaFlag::TransferComplete | DmaFlag::TransferError;
        (0..LOOKS).find(|_| receives.flags().intersects(ended));
        spi.cr2()
            .modify(|_, w| w.rxdmaen().clear_bit().txdmaen().clear_bit());
        // The received bytes are read afterwards.
        asm::dmb();
        if receives.flags() & ended == DmaFlag::TransferComplete && !sends.is_transfer_error() {
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
