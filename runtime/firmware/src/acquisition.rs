//! A converter: read in every tick, and started again after faults.

use crate::schedule::PERIOD_US;
use embedded_hal::delay::DelayNs;
use hal_adapters::adc::stuck::StuckWatch;
use hal_adapters::adc::{AdcError, FrameSampler};
use runtime::RawFrame;

/// Ticks in a row without codes after which the converter is started again: 32 ms. A start
/// takes up to 210 bytes of SPI, about 0.2 ms.
pub const RESTART_TICKS: u16 = (32_000 / PERIOD_US) as u16;

/// A converter and its recent faults.
#[derive(Debug)]
pub struct Acquisition<A: FrameSampler> {
    converter: A,
    watch: StuckWatch,
    /// The fault of a trigger: the sample that follows reports it.
    trigger_fault: Option<AdcError<A::Bus>>,
    faults_in_a_row: u16,
    faults: u32,
    starts: u32,
}

impl<A: FrameSampler> Acquisition<A> {
    /// A converter that is not started yet: see [`Self::start`].
    pub const fn new(converter: A) -> Self {
        Self {
            converter,
            watch: StuckWatch::new(A::CODE_BITS),
            trigger_fault: None,
            faults_in_a_row: 0,
            faults: 0,
            starts: 0,
        }
    }

    /// Resets the converter and sets it up.
    ///
    /// # Errors
    /// See [`AdcError`]. Ticks go on, and the converter is started again after [`RESTART_TICKS`].
    pub fn start(&mut self, delay: &mut impl DelayNs) -> Result<(), AdcError<A::Bus>> {
        self.starts = self.starts.saturating_add(1);
        self.faults_in_a_row = 0;
        self.converter.start(delay)
    }

    /// Starts the conversion of a tick. The sample of this tick reports a fault.
    pub fn trigger(&mut self, delay: &mut impl DelayNs) {
        self.trigger_fault = self.converter.trigger(delay).err();
    }

    /// The codes of a tick.
    ///
    /// # Errors
    /// See [`AdcError`]. After [`RESTART_TICKS`] such ticks in a row, or one with a setting that
    /// was lost, the converter is started again instead of being read, and can give codes from the
    /// next tick on.
    pub fn sample(
        &mut self,
        sequence: u32,
        time_us: u32,
        delay: &mut impl DelayNs,
    ) -> Result<RawFrame, AdcError<A::Bus>> {
        let result = self.try_sample(sequence, time_us, delay);
        if result.is_ok() {
            self.faults_in_a_row = 0;
        } else {
            self.faults = self.faults.saturating_add(1);
            self.faults_in_a_row = self.faults_in_a_row.saturating_add(1);
        }
        result
    }

    /// Ticks without codes since the program started. Saturates.
    pub const fn faults(&self) -> u32 {
        self.faults
    }

    /// How often the converter was started, the first time included. Saturates.
    pub const fn starts(&self) -> u32 {
        self.starts
    }

    fn try_sample(
        &mut self,
        sequence: u32,
        time_us: u32,
        delay: &mut impl DelayNs,
    ) -> Result<RawFrame, AdcError<A::Bus>> {
        if let Some(fault) = self.trigger_fault.take() {
            return Err(fault);
        }
        if self.faults_in_a_row >= RESTART_TICKS {
            self.start(delay)?;
            let (ready, read) = (0, 0);
            return Err(AdcError::NotReady { ready, read });
        }
        let sampled = self.converter.sample(sequence, time_us);
        // The next samples would be wrong, and a part can report it only once.
        if let Err(AdcError::WrongSetting { .. }) = sampled {
            self.faults_in_a_row = RESTART_TICKS;
        }
        self.watch.pass(sampled?)
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use embedded_hal::spi::{ErrorKind, MODE_1, Mode};
    use hal_adapters::adc::thermometer::AnalogInput;

    struct NoDelay;
    impl DelayNs for NoDelay {
        fn delay_ns(&mut self, _: u32) {}
    }

    /// A converter that fails while `broken` is set, and loses its settings then.
    #[derive(Debug, Default)]
    struct Fake {
        broken: bool,
        set_up: bool,
        /// Reports once that a setting is lost.
        loses_setting: bool,
        code: i32,
    }

    impl FrameSampler for Fake {
        type Bus = ErrorKind;
        const SPI_MODE: Mode = MODE_1;
        const SPI_HZ_MAX: u32 = 25_000_000;
        const SETTLE_US: u32 = 110;
        const SAMPLE_US: u32 = 60;
        const CODE_BITS: u32 = 16;
        const INPUT: AnalogInput = AnalogInput {
            codes_per_v: 3_200.0,
            ohm: 1e6,
            bias_v: 0.0,
        };

        fn start(&mut self, _: &mut impl DelayNs) -> Result<(), AdcError<ErrorKind>> {
            self.set_up = !self.broken;
            if self.broken {
                return Err(AdcError::Silent { level: 0 });
            }
            Ok(())
        }

        fn trigger(&mut self, _: &mut impl DelayNs) -> Result<(), AdcError<ErrorKind>> {
            Ok(())
        }

        fn sample(&mut self, sequence: u32, time_us: u32) -> Result<RawFrame, AdcError<ErrorKind>> {
            if core::mem::take(&mut self.loses_setting) {
                let (register, found, wanted) = (3, 0, 1);
                return Err(AdcError::WrongSetting {
                    register,
                    found,
                    wanted,
                });
            }
            self.set_up &= !self.broken;
            if !self.set_up {
                return Err(AdcError::Silent { level: 0 });
            }
            self.code += 1;
            Ok(RawFrame::new(
                [self.code; 3],
                [self.code; 3],
                sequence,
                time_us,
            ))
        }
    }

    #[test]
    fn a_converter_that_loses_a_setting_is_started_in_the_next_tick() {
        let mut adc = Acquisition::new(Fake::default());
        assert_eq!(adc.start(&mut NoDelay), Ok(()));
        adc.converter.loses_setting = true;
        let errors = [(); 4].map(|()| adc.sample(0, 0, &mut NoDelay).map_err(|e| e.number()));
        assert_eq!(errors.map(|e| e.err()), [Some(5), Some(7), None, None]);
        assert_eq!(adc.starts(), 2);
    }

    #[test]
    fn a_converter_that_comes_back_is_started_again_by_itself() {
        let mut adc = Acquisition::new(Fake::default());
        assert_eq!(adc.start(&mut NoDelay), Ok(()));
        assert!(adc.sample(0, 0, &mut NoDelay).is_ok());
        adc.converter.broken = true;
        let faults = (0..200).filter(|&k| adc.sample(k, 0, &mut NoDelay).is_err());
        assert_eq!(faults.count(), 200);
        adc.converter.broken = false;
        let back =
            (0..=2 * u32::from(RESTART_TICKS)).find(|&k| adc.sample(k, 0, &mut NoDelay).is_ok());
        assert!(back.is_some());
        assert_eq!(adc.starts(), 2 + 199 / u32::from(RESTART_TICKS));
        assert_eq!(adc.faults(), 200 + back.unwrap_or(0));
    }
}
