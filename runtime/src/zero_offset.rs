//! Re-zero: the zero deviation measured at rest.
//!
//! The stage stands at its zero. The poses of N ticks are averaged; the mean is the pose
//! that the decoder shows where it should show none, and is subtracted from then on. The
//! run refuses when the stage moves: when the poses spread further than noise does, or the
//! means of the two halves differ. It also refuses when the stage
//! stands elsewhere: when the mean is larger than a zero deviation can be, when the stage is
//! lifted or tilted, or when a pose lies outside the calibrated range.

use crate::decoder::Reading;
use crate::pose::{PlanarPose, pairwise};
use crate::status::Status;

/// How long to average, and what still counts as rest at the zero.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ZeroOffsetSettings {
    /// Ticks to average, [`ZeroOffsetSettings::TICKS_MIN`] or more; an odd number is rounded down
    /// to even.
    pub ticks: u16,
    /// Largest peak-to-peak spread of X, Y, Rz over the run, m, m, rad.
    pub spread_max: [f32; 3],
    /// Largest difference between the means of the run's halves, m, m, rad.
    pub drift_max: [f32; 3],
    /// Largest magnitude of the zero deviation in X, Y, Rz, m, m, rad.
    pub zero_max: [f32; 3],
    /// Largest magnitude of Z, Rx, Ry in any tick, m, rad, rad.
    pub vertical_max: [f32; 3],
}

impl ZeroOffsetSettings {
    /// Fewest ticks of a run: half a second at 2 ms. The mean of fewer is too noisy, and a
    /// slow movement is not seen.
    pub const TICKS_MIN: u16 = 250;
}

impl Default for ZeroOffsetSettings {
    /// 500 ticks (1 s). Spread: ten times the rms noise of a sound stage (1 um, 0.5 um,
    /// 2.4 urad), which noise exceeds in one run of millions. Drift: twelve times the
    /// standard deviation of the difference of two means of 250.
    ///
    /// Zero: probes that deviate by 10 um each, the range that the calibration allows (below
    /// eq. 30), show at most 40 um, 14 um, 71 urad in the designed geometry at the smallest
    /// sensitivities; rounded up. Z, Rx, Ry: a fifth of the range of 250 um and a tenth of that
    /// of 1,000 urad. A sensitivity changes by about 1 % from there to zero, that is, by less
    /// than 1 um of the largest zero deviation.
    fn default() -> Self {
        Self {
            ticks: 500,
            spread_max: [10e-6, 5e-6, 25e-6],
            drift_max: [1e-6, 0.5e-6, 2.5e-6],
            zero_max: [50e-6, 20e-6, 100e-6],
            vertical_max: [50e-6, 100e-6, 100e-6],
        }
    }
}

/// Why a re-zero was refused. The zero deviation is unchanged.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ZeroOffsetRefusal {
    /// Fewer than [`ZeroOffsetSettings::TICKS_MIN`] ticks were asked for.
    TooShort {
        /// Ticks asked for.
        ticks: u16,
    },
    /// A tick of the run gave no planar pose.
    NoPose {
        /// The status of that tick.
        status: Status,
    },
    /// The poses spread further than rest allows.
    Moved {
        /// Axis, 0 to 2 for X, Y, Rz.
        axis: u8,
        /// Peak-to-peak spread, m or rad.
        spread: f32,
    },
    /// The pose drifted between the run's halves.
    Drifted {
        /// Axis, 0 to 2 for X, Y, Rz.
        axis: u8,
        /// Difference of the means, m or rad.
        drift: f32,
    },
    /// The stage stands too far from its zero.
    OutOfBounds {
        /// Axis, 0 to 5 for X, Y, Rz, Z, Rx, Ry.
        axis: u8,
        /// The mean of X, Y or Rz, or Z, Rx or Ry of a tick, m or rad.
        value: f32,
    },
    /// A pose of the run lies outside the calibrated range.
    Extrapolated {
        /// The status of that tick.
        status: Status,
    },
}

/// Where a re-zero stands.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ZeroOffsetState {
    /// No re-zero was asked for.
    Idle,
    /// It runs.
    Running {
        /// Ticks still to come.
        ticks_left: u16,
    },
    /// It ended, and this pose is now subtracted.
    Done {
        /// Mean pose at rest, m, m, rad.
        zero: PlanarPose<f32>,
    },
    /// It was refused.
    Refused(ZeroOffsetRefusal),
}

/// One run in progress. Sums are of differences from the first pose, so that `f32` keeps
/// their digits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ZeroOffsetRun {
    settings: ZeroOffsetSettings,
    half: u16,
    taken: u16,
    first: [f32; 3],
    low: [f32; 3],
    high: [f32; 3],
    sum_first_half: [f32; 3],
    sum_second_half: [f32; 3],
}

impl ZeroOffsetRun {
    /// Starts a run.
    ///
    /// # Errors
    /// [`ZeroOffsetRefusal::TooShort`].
    pub const fn start(settings: ZeroOffsetSettings) -> Result<Self, ZeroOffsetRefusal> {
        if settings.ticks < ZeroOffsetSettings::TICKS_MIN {
            return Err(ZeroOffsetRefusal::TooShort {
                ticks: settings.ticks,
            });
        }
        Ok(Self {
            settings,
            half: settings.ticks / 2,
            taken: 0,
            first: [0.0; 3],
            low: [0.0; 3],
            high: [0.0; 3],
            sum_first_half: [0.0; 3],
            sum_second_half: [0.0; 3],
        })
    }

    /// Takes one reading, decoded with no zero deviation subtracted.
    pub fn take(&mut self, reading: &Reading) -> ZeroOffsetState {
        let Some(pose) = reading.planar() else {
            return ZeroOffsetState::Refused(ZeroOffsetRefusal::NoPose {
                status: reading.status,
            });
        };
        if reading.status.any(EXTRAPOLATED) {
            return ZeroOffsetState::Refused(ZeroOffsetRefusal::Extrapolated {
                status: reading.status,
            });
        }
        let vertical = reading.pose.vertical.to_array();
        if let Some((axis, value)) = beyond(vertical, self.settings.vertical_max) {
            return ZeroOffsetState::Refused(ZeroOffsetRefusal::OutOfBounds {
                axis: axis + 3,
                value,
            });
        }
        let pose = pose.to_array();
        if self.taken == 0 {
            self.first = pose;
        }
        let d = pairwise(pose, self.first, |now, first| now - first);
        let sum = if self.taken < self.half {
            &mut self.sum_first_half
        } else {
            &mut self.sum_second_half
        };
        *sum = pairwise(*sum, d, |sum, d| sum + d);
        for ((low, high), d) in self.low.iter_mut().zip(&mut self.high).zip(d) {
            *low = if d < *low { d } else { *low };
            *high = if d > *high { d } else { *high };
        }
        self.taken = self.taken.saturating_add(1);
        let spread = pairwise(self.high, self.low, |high, low| high - low);
        if let Some((axis, spread)) = beyond(spread, self.settings.spread_max) {
            return ZeroOffsetState::Refused(ZeroOffsetRefusal::Moved { axis, spread });
        }
        let all = self.half.saturating_mul(2);
        if self.taken < all {
            ZeroOffsetState::Running {
                ticks_left: all - self.taken,
            }
        } else {
            self.finish()
        }
    }

    fn finish(&self) -> ZeroOffsetState {
        let n = f32::from(self.half);
        let (early, late) = (self.sum_first_half, self.sum_second_half);
        let drift = pairwise(late, early, |late, early| (late - early) / n);
        if let Some((axis, drift)) = beyond(drift, self.settings.drift_max) {
            return ZeroOffsetState::Refused(ZeroOffsetRefusal::Drifted { axis, drift });
        }
        let all = n + n;
        let mean = pairwise(early, late, |early, late| (early + late) / all);
        let zero = pairwise(self.first, mean, |first, mean| first + mean);
        if let Some((axis, value)) = beyond(zero, self.settings.zero_max) {
            return ZeroOffsetState::Refused(ZeroOffsetRefusal::OutOfBounds { axis, value });
        }
        ZeroOffsetState::Done {
            zero: PlanarPose::from_array(zero),
        }
    }
}

/// Either half of the pose lies outside the calibrated range.
const EXTRAPOLATED: Status = Status::PLANAR_EXTRAPOLATED.with(Status::VERTICAL_EXTRAPOLATED);

/// The first of three values above its limit in magnitude, with its index. It is called four times
/// off the tick, so it is not inlined.
#[inline(never)]
fn beyond(values: [f32; 3], limits: [f32; 3]) -> Option<(u8, f32)> {
    (0u8..)
        .zip(values.into_iter().zip(limits))
        .find_map(|(axis, (value, limit))| (value.abs() > limit).then_some((axis, value)))
}

#[cfg(test)]
#[path = "zero_offset_tests.rs"]
mod tests;
