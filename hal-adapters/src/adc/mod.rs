//! Converters on SPI: six codes of one servo period into one [`RawFrame`].
//!
//! | module | part | content |
//! |---|---|---|
//! | [`ads131m08`] | TI ADS131M08 | eight channels of 24 bits sampled at once, CRC over every frame |
//! | [`ads8688`] | TI ADS8688 | eight channels of 16 bits, sampled one after the other, no CRC; no thermometers |
//! | [`Channels`] | any | which input carries which sensor |
//! | [`thermometer`] | Semitec 103AT-2, TI TMP235 | temperatures of the magnets' mount and of the stage body at free inputs |
//! | [`stuck`] | any | codes that never change: a converter or a sensor that is frozen |
//!
//! Which to choose: the first where the stage moves fast or the cable is long. The skew of the
//! second costs 58 nm at the fastest motion of a service log (4.8 mm/s; see [`ads8688`]),
//! a tenth of the Hall noise, and the only check in its frames is a signature of six bits.
//!
//! A driver owns an [`SpiDevice`](embedded_hal::spi::SpiDevice), which owns chip select, the part's control pin, and a
//! [`Clock`]: it stamps each sample itself, and refuses a sample that it cannot stamp to 10 us. It allocates nothing,
//! cannot panic, and its waits are short: 0.5 ms in [`FrameSampler::start`], 4 us in [`FrameSampler::trigger`].
//! The published driver for the ADS131M08 drives chip select and data-ready pins itself, waits 100 ms at start and
//! returns the previous codes in place of damaged codes. There is no published driver for the ADS8688.
//!
//! ```
//! use embedded_hal_mock::eh1::{digital, spi};
//! use hal_adapters::adc::{Ads8688, Channels, Clock, FrameSampler};
//!
//! // Mocks in place of a HAL's SPI device and pin: a frame that starts the sequence, then one
//! // for each of the six inputs, all with code 0x8001 and the input's signature, then a register.
//! let frame = |sent: [u8; 6], read: [u8; 6]| {
//!     use spi::Transaction as T;
//!     [T::transaction_start(), T::transfer_in_place(sent.to_vec(), read.to_vec()), T::transaction_end()]
//! };
//! let tick = |register: u8, value: u8| {
//!     let mut frames = frame([0xa0, 0, 0, 0, 0, 0], [0; 6]).to_vec();
//!     for input in 0..6 {
//!         frames.extend(frame([0; 6], [0, 0, 0x80, 0x01, input << 4 | 0b0100, 0]));
//!     }
//!     frames.extend(frame([register << 1, 0, 0, 0, 0, 0], [0, 0, value, 0, 0, 0]));
//!     frames
//! };
//! let expected = [tick(0x01, 0x3f), tick(0x02, 0xc0)].concat();
//! let (mut bus, mut pin) = (spi::Mock::new(&expected), digital::Mock::new(&[]));
//!
//! // In place of a timer.
//! let us = core::cell::Cell::new(0);
//! struct Timer<'t>(&'t core::cell::Cell<u32>);
//! impl Clock for Timer<'_> {
//!     fn now_us(&mut self) -> u32 {
//!         self.0.get()
//!     }
//! }
//! let mut converter = Ads8688::new(bus.clone(), pin.clone(), Timer(&us), Channels::IN_ORDER);
//! // Once: converter.start()?; then in every tick:
//! converter.trigger()?;
//! // This part's reference needs 24 ms: until then there are no codes.
//! assert!(converter.sample(0).is_err());
//! us.set(24_000);
//! let frame = converter.sample(12)?;
//! assert_eq!((frame.hall, frame.capacitive, frame.sequence), ([1; 3], [1; 3], 12));
//! # bus.done();
//! # pin.done();
//! # Ok::<(), hal_adapters::adc::AdcError<embedded_hal::spi::ErrorKind>>(())
//! ```

pub mod ads131m08;
pub mod ads8688;
mod channels;
pub mod stuck;
pub mod thermometer;

pub use ads131m08::Ads131m08;
pub use ads8688::Ads8688;
pub use channels::Channels;

use embedded_hal::digital;
use embedded_hal::spi::Mode;
use runtime::RawFrame;

/// Samples all six codes of one servo period.
///
/// Call [`trigger`](Self::trigger) on the servo's schedule, and [`sample`](Self::sample)
/// [`SETTLE_US`](Self::SETTLE_US) later. After an error the next period can be tried directly,
/// or after another [`start`](Self::start).
///
/// The constants are all that a board needs to know of the part. Drivers are made by
/// `new(spi, pin, clock, channels)`, `pin` being the part's one control pin, so that a board can name
/// the part by a type alone.
pub trait FrameSampler {
    /// The bus's own error.
    type Bus: embedded_hal::spi::Error;

    /// SPI mode of the part.
    const SPI_MODE: Mode;

    /// Fastest SPI clock of the part, Hz.
    const SPI_HZ_MAX: u32;

    /// From the trigger until the codes can be read, us.
    const SETTLE_US: u32;

    /// Bits of a code: 16 or 24.
    const CODE_BITS: u32;

    /// Resets the part, checks its identity, sets it up and reads the settings back.
    ///
    /// # Errors
    /// See [`AdcError`]; the part may then be in any state, and this may be called again.
    fn start(&mut self) -> Result<(), AdcError<Self::Bus>>;

    /// Starts the conversion of one period, on parts that can be triggered.
    ///
    /// # Errors
    /// [`AdcError::Pin`].
    fn trigger(&mut self) -> Result<(), AdcError<Self::Bus>>;

    /// Reads the codes of one period. `sequence` goes into the frame unchanged; the frame's time is the middle of what was
    /// sampled, by the driver's clock. Its temperatures were read in the last 100 ms, by a driver that reads thermometers.
    /// A code at a rail is no error here: the decoder's window refuses it.
    ///
    /// # Errors
    /// See [`AdcError`]; the period then has no codes at all.
    fn sample(&mut self, sequence: u32) -> Result<RawFrame, AdcError<Self::Bus>>;
}

/// As [`FrameSampler::trigger`] and [`FrameSampler::sample`], for an executor: other tasks run while the codes settle. The
/// frames on SPI block it: 69 us with the ADS131M08 at 10.5 MHz.
///
/// # Errors
/// As both.
#[cfg(feature = "async")]
pub async fn sample_async<S: FrameSampler>(
    sampler: &mut S,
    delay: &mut impl embedded_hal_async::delay::DelayNs,
    sequence: u32,
) -> Result<RawFrame, AdcError<S::Bus>> {
    sampler.trigger()?;
    delay.delay_us(S::SETTLE_US).await;
    sampler.sample(sequence)
}

/// A clock that never stops.
pub trait Clock {
    /// Now, us, wrapping.
    fn now_us(&mut self) -> u32;
}

/// The data-ready line of a converter: a timer notes its edges by itself, so that no interrupt delays them.
pub trait DataReady: Clock {
    /// When the line fell last, us of the clock; `None` if it did not since the last call.
    fn fell_us(&mut self) -> Option<u32>;
}

/// Why a converter gave no codes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum AdcError<B> {
    /// The bus reports an error of its own.
    #[error("the bus to the converter: {0:?}")]
    Bus(B),
    /// A control pin reports an error of its own.
    #[error("a control pin of the converter: {0:?}")]
    Pin(digital::ErrorKind),
    /// The data line never moved: no power, no clock, a broken wire.
    #[error("the converter is silent: nothing but {level:#04x} was read")]
    Silent {
        /// The value of every byte that was read.
        level: u8,
    },
    /// A different part answers, or the right one was not reset.
    #[error("another part: it says {found:#06x}, not {expected:#06x}")]
    WrongId {
        /// What identifies the part that is there.
        found: u16,
        /// What identifies the part that was expected.
        expected: u16,
    },
    /// A setting does not read back, or was lost later.
    #[error("register {register:#04x} of the converter is {found:#06x}, not {wanted:#06x}")]
    WrongSetting {
        /// Address of the register.
        register: u8,
        /// The value that was read.
        found: u16,
        /// The value that was wanted.
        wanted: u16,
    },
    /// The check of a frame fails.
    #[error("damaged frame: check {received:04x}, computed {computed:04x}")]
    WrongCheck {
        /// The check that the frame carries.
        received: u16,
        /// The check of its bytes.
        computed: u16,
    },
    /// No new codes: the part does not convert.
    #[error("no new codes: inputs {ready:#010b} of {read:#010b}")]
    NotReady {
        /// Bit k set: input k had a new code.
        ready: u8,
        /// Bit k set: input k is read.
        read: u8,
    },
    /// The code of a different input came, or a frame without the part's signature.
    #[error("a frame signed {found:#08b} came where {expected:#08b} belongs")]
    WrongInput {
        /// The signature that came.
        found: u8,
        /// The signature that was expected.
        expected: u8,
    },
    /// The codes of a sensor stayed the same for too long.
    #[error("codes of sensor {channel} the same for {periods} periods")]
    Stuck {
        /// The first such sensor: 0 to 2 Hall probes A to C, 3 to 5 gaps 1 to 3.
        channel: u8,
        /// For how many periods.
        periods: u8,
    },
    /// The trigger does not reach the part: the time of its samples is unknown.
    #[error("the trigger does not reach the converter")]
    NoSync,
    /// The instant of the sample is not known to 10 us: no edge of the data-ready line, a converter's clock that is far
    /// off, or frames that are too slow or were interrupted.
    #[error("the instant of the sample is not known to 10 us")]
    UnknownInstant,
}

impl<B> AdcError<B> {
    /// A number for status frames, the same in every version: 1 for the first variant. 9 meant
    /// all six sensors stuck; a stuck sensor is 0x20 + its channel.
    pub const fn number(&self) -> u8 {
        match self {
            Self::Bus(_) => 1,
            Self::Pin(_) => 2,
            Self::Silent { .. } => 3,
            Self::WrongId { .. } => 4,
            Self::WrongSetting { .. } => 5,
            Self::WrongCheck { .. } => 6,
            Self::NotReady { .. } => 7,
            Self::WrongInput { .. } => 8,
            Self::NoSync => 10,
            Self::UnknownInstant => 11,
            Self::Stuck { channel, .. } => 0x20 + *channel,
        }
    }
}

/// The level of a line that never moved: the frame is all 0x00 or all 0xFF.
fn silent(bytes: &[u8]) -> Option<u8> {
    let first = *bytes.first()?;
    let quiet = first == 0x00 || first == 0xff;
    (quiet && bytes.iter().all(|&b| b == first)).then_some(first)
}

fn check_id<B>(found: u16, mask: u16, expected: u16) -> Result<(), AdcError<B>> {
    if found & mask == expected {
        Ok(())
    } else {
        Err(AdcError::WrongId { found, expected })
    }
}

/// Compares the value of a register with the wanted value.
fn compare<B>(register: u8, found: u16, wanted: u16) -> Result<(), AdcError<B>> {
    if found == wanted {
        return Ok(());
    }
    Err(AdcError::WrongSetting {
        register,
        found,
        wanted,
    })
}

#[cfg(all(test, feature = "async"))]
mod async_tests;
#[cfg(test)]
mod testing {
    extern crate std;

    use super::{AdcError, Channels, Clock, DataReady, FrameSampler};
    use embedded_hal::spi::{ErrorKind, ErrorType, Operation, SpiDevice};
    use embedded_hal_mock::eh1::digital::{Mock as PinMock, State, Transaction as PinTransaction};
    use embedded_hal_mock::eh1::spi::{Mock, Transaction};
    use std::vec::Vec;

    /// Frames on a bus.
    pub(super) type Frames = Vec<Transaction<u8>>;

    /// One frame: what is sent, and what comes back meanwhile.
    pub(super) fn transfer(sent: Vec<u8>, back: Vec<u8>) -> Frames {
        let transfer = Transaction::transfer_in_place(sent, back);
        let (start, end) = (
            Transaction::transaction_start(),
            Transaction::transaction_end(),
        );
        [start, transfer, end].into()
    }

    /// Runs `work` on a part. Its bus must carry exactly `expected`, its pin exactly `levels`.
    pub(super) fn on_part<S, T>(
        new: fn(Mock<u8>, PinMock, Line, Channels) -> S,
        line: Line,
        expected: &Frames,
        levels: &[State],
        work: impl FnOnce(&mut S) -> T,
    ) -> T {
        let levels: Vec<_> = levels.iter().copied().map(PinTransaction::set).collect();
        let (mut bus, mut pin) = (Mock::new(expected), PinMock::new(&levels));
        let result = work(&mut new(bus.clone(), pin.clone(), line, Channels::IN_ORDER));
        bus.done();
        pin.done();
        result
    }

    pub(super) fn keeps_the_error_of_the_bus<S: FrameSampler<Bus = ErrorKind>>(
        new: fn(Broken, NoPin, Line, Channels) -> S,
    ) {
        let mut part = new(Broken, NoPin, Line::every(8), Channels::IN_ORDER);
        let error = AdcError::Bus(ErrorKind::ModeFault);
        assert_eq!(part.start(), Err(error));
        assert_eq!(part.sample(0), Err(error));
    }

    /// A clock that shows some us more at each look, and a data-ready line that has just fallen at each look, 64 us
    /// after the look before.
    #[derive(Debug)]
    pub(super) struct Line {
        now_us: u32,
        fell_us: u32,
        step_us: u32,
    }

    impl Line {
        /// The first sample of either part is at 14,000 us.
        pub(super) const fn every(step_us: u32) -> Self {
            Self {
                now_us: 13_986,
                fell_us: 13_973,
                step_us,
            }
        }
    }

    impl Clock for Line {
        fn now_us(&mut self) -> u32 {
            self.now_us += self.step_us;
            self.now_us
        }
    }

    impl DataReady for Line {
        fn fell_us(&mut self) -> Option<u32> {
            self.fell_us += 64;
            self.now_us = self.fell_us;
            Some(self.fell_us)
        }
    }

    /// An unconnected pin.
    pub(super) struct NoPin;

    impl embedded_hal::digital::ErrorType for NoPin {
        type Error = core::convert::Infallible;
    }

    impl embedded_hal::digital::OutputPin for NoPin {
        fn set_low(&mut self) -> Result<(), Self::Error> {
            Ok(())
        }

        fn set_high(&mut self) -> Result<(), Self::Error> {
            Ok(())
        }
    }

    /// A bus that always fails.
    pub(super) struct Broken;

    impl ErrorType for Broken {
        type Error = ErrorKind;
    }

    impl SpiDevice for Broken {
        fn transaction(&mut self, _: &mut [Operation<'_, u8>]) -> Result<(), ErrorKind> {
            Err(ErrorKind::ModeFault)
        }
    }
}
