//! A converter: read in every tick, and started again after faults.

use crate::schedule::Period;
use hal_adapters::adc::stuck::StuckWatch;
use hal_adapters::adc::{AdcError, FrameSampler};
use runtime::RawFrame;

/// Time without codes after which the converter is started again, ms. A start
/// takes up to 210 bytes of SPI and the measurement of a period, about 0.7 ms.
pub const RESTART_MS: u32 = 32;

/// A converter and its recent faults.
#[derive(Debug)]
pub struct Acquisition<A: FrameSampler> {
    converter: A,
    watch: StuckWatch,
    /// The fault of a trigger: the sample that follows reports it.
    trigger_fault: Option<AdcError<A::Bus>>,
    restart_ticks: u32,
    faults_in_a_row: u32,
    /// Ticks without codes since the program started. Saturates.
    pub faults: u32,
    /// How often the converter was started, the first time included. Saturates.
    pub starts: u32,
}

impl<A: FrameSampler> Acquisition<A> {
    /// A converter that is not started yet: see [`Self::start`].
    pub fn new(converter: A, period: Period) -> Self {
        Self {
            converter,
            watch: StuckWatch::new(A::CODE_BITS),
            trigger_fault: None,
            restart_ticks: period.ticks_in_ms(RESTART_MS),
            faults_in_a_row: 0,
            faults: 0,
            starts: 0,
        }
    }

    /// Resets the converter and sets it up.
    ///
    /// # Errors
    /// See [`AdcError`]. Ticks go on, and the converter is started again after [`RESTART_MS`].
    pub fn start(&mut self) -> Result<(), AdcError<A::Bus>> {
        self.starts = self.starts.saturating_add(1);
        self.faults_in_a_row = 0;
        self.converter.start()
    }

    /// Starts the conversion of a tick. The sample of this tick reports a fault.
    pub fn trigger(&mut self) {
        self.trigger_fault = self.converter.trigger().err();
    }

    /// The codes of a tick.
    ///
    /// # Errors
    /// See [`AdcError`]. After [`RESTART_MS`] of such ticks, or one with a setting that
    /// was lost, the converter is started again instead of being read, and can give codes from the
    /// next tick on.
    pub fn sample(&mut self, sequence: u32) -> Result<RawFrame, AdcError<A::Bus>> {
        let result = self.try_sample(sequence);
        if result.is_ok() {
            self.faults_in_a_row = 0;
        } else {
            self.faults = self.faults.saturating_add(1);
            self.faults_in_a_row = self.faults_in_a_row.saturating_add(1);
        }
        result
    }

    fn try_sample(&mut self, sequence: u32) -> Result<RawFrame, AdcError<A::Bus>> {
        if let Some(fault) = self.trigger_fault.take() {
            return Err(fault);
        }
        if self.faults_in_a_row >= self.restart_ticks {
            self.start()?;
            let (ready, read) = (0, 0);
            return Err(AdcError::NotReady { ready, read });
        }
        let sampled = self.converter.sample(sequence);
        // The next samples would be wrong, and a part can report it only once.
        if let Err(AdcError::WrongSetting { .. }) = sampled {
            self.faults_in_a_row = self.restart_ticks;
        }
        self.watch.pass(sampled?)
    }
}
