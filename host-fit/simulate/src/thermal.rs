//! The temperatures of a stage and their effect, for the mount M (magnets, framework) and the body H (Hall
//! elements, stage).
//!
//! | quantity | drawn: mean, standard deviation | source |
//! |---|---|---|
//! | remanence, NdFeB, with M | -0.11 %/K, 0.005 for a stage and 0.005 for each magnet | data sheets of magnets; scatter assumed |
//! | gain of a Hall element, with H | 0, 0.01 %/K | data sheets of uncompensated parts |
//! | offset of a Hall element, with H | 0, 1.6 uT/K at 1.3 T of remanence | same |
//! | gap, with M | 0.4, 0.2 um/K | 20 mm of metal |
//! | expansion of stage (H) and of framework (M) | 6e-6, 2e-6 1/K | ceramics, granite, steel |
//! | error of a temperature sensor, for a run | 0, 25 mK | from run to run stable to 0.1 K |
//! | its noise, each 100 ms | 0, 20 mK | `README.md` of the given logs |
//!
//! The working day is as in the given logs: work from 0 to 4 h and from 5 h on, in a room with a daily
//! wave of temperature.

use super::assembly::Assembly;
use super::probe::{REMANENCE_T, ThermalChange};
use super::random::{Purpose, Stream};
use std::f64::consts::TAU;

/// Temperature during assembly, where the amplifiers are trimmed, degC.
pub const ASSEMBLED_C: f64 = 20.0;
/// How long a converter holds a temperature, s.
pub const HELD_S: f64 = 0.1;

const REMANENCE_PER_K: f64 = -1.1e-3;
const REMANENCE_SCATTER_PER_K: f64 = 5e-5;
const HALL_GAIN_PER_K: f64 = 1e-4;
const HALL_OFFSET_PER_K: f64 = 1.6e-6 / REMANENCE_T;
const GAP_M_PER_K: [f64; 2] = [0.4e-6, 0.2e-6];
const EXPANSION_PER_K: [f64; 2] = [6e-6, 2e-6];
const SENSOR_K: f64 = 0.025;
const SENSOR_NOISE_K: f64 = 0.02;

/// Rise of the body over the room in work, K, and its time constant, s.
const BODY: (f64, f64) = (5.2, 22.0 * 60.0);
/// Rise of the mount over the rise of the body, and its time constant, s.
const MOUNT: (f64, f64) = (0.36, 46.0 * 60.0);
/// Mean of the room, degC, amplitude of its wave, K, and the hour of the rising zero crossing.
const ROOM: (f64, f64, f64) = (22.0, 1.8, 4.0);
/// Work begins and pauses, h.
const BEGINS_AND_PAUSES: [f64; 4] = [0.0, 4.0, 5.0, f64::INFINITY];

/// Temperatures of mount and body during a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Climate {
    /// A working day.
    Day {
        /// Begin of the run, hours after the begin of work. Before work the stage is as warm as the room.
        hour: f64,
    },
    /// All parts at one temperature, degC.
    Steady(f64),
}

impl Climate {
    /// Temperatures of mount and body at a time after the begin of the run (s), degC.
    pub fn at(&self, time_s: f64) -> [f64; 2] {
        match *self {
            Self::Steady(celsius) => [celsius; 2],
            Self::Day { hour } => {
                let hour = hour + time_s / 3600.0;
                let (mean_c, wave_k, rises) = ROOM;
                let room_c = mean_c + wave_k * libm::sin(TAU / 24.0 * (hour - rises));
                let (rise_k, lag_s) = BODY;
                let (part, slow_s) = MOUNT;
                let (mut body, mut mount) = (0.0, 0.0);
                for (switch, at) in BEGINS_AND_PAUSES.into_iter().enumerate() {
                    let since_s = (hour - at) * 3600.0;
                    if since_s > 0.0 {
                        let step = if switch % 2 == 0 { 1.0 } else { -1.0 };
                        let [fast, slow] = [lag_s, slow_s].map(|lag| libm::exp(-since_s / lag));
                        body += step * (1.0 - fast);
                        // The mount follows the body.
                        mount += step * (1.0 - (slow_s * slow - lag_s * fast) / (slow_s - lag_s));
                    }
                }
                [room_c + part * rise_k * mount, room_c + rise_k * body]
            }
        }
    }

    /// A number for the noise of a run in this climate.
    pub(super) const fn number(&self) -> u64 {
        match *self {
            Self::Day { hour } => hour.to_bits().rotate_left(1),
            Self::Steady(celsius) => celsius.to_bits(),
        }
    }
}

/// Temperature coefficients of the parts of a stage, of A, B, C where there are three.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Thermal {
    /// Remanence of the magnets, 1/K.
    pub remanence_per_k: [f64; 3],
    /// Gain of the Hall elements, 1/K.
    pub gain_per_k: [f64; 3],
    /// Offset of the Hall elements, designed remanences per K.
    pub offset_per_k: [f64; 3],
    /// Growth of the gaps with the mount, m/K.
    pub gap_m_per_k: [f64; 3],
    /// Expansion of the framework (with the mount) and of the stage (with the body), 1/K.
    pub expansion_per_k: [f64; 2],
}

impl Thermal {
    /// The coefficients for the stage of a seed.
    pub fn draw(seed: u64) -> Self {
        let mut random = Stream::new(seed, Purpose::Thermal, 0);
        let mean = REMANENCE_PER_K + random.normal(REMANENCE_SCATTER_PER_K);
        let mut three = |mean: f64, deviation| [(); 3].map(|()| mean + random.normal(deviation));
        Self {
            remanence_per_k: three(mean, REMANENCE_SCATTER_PER_K),
            gain_per_k: three(0.0, HALL_GAIN_PER_K),
            offset_per_k: three(0.0, HALL_OFFSET_PER_K),
            gap_m_per_k: three(GAP_M_PER_K[0], GAP_M_PER_K[1]),
            expansion_per_k: [(); 2]
                .map(|()| EXPANSION_PER_K[0] + random.normal(EXPANSION_PER_K[1])),
        }
    }

    /// A stage with mount and body at these temperatures, degC.
    pub fn warmed(&self, assembly: &Assembly, celsius: [f64; 2]) -> Assembly {
        let [mount_k, body_k] = celsius.map(|celsius| celsius - ASSEMBLED_C);
        let probes = [0, 1, 2].map(|k| {
            assembly.probes[k].warmed(&ThermalChange {
                remanence: 1.0 + self.remanence_per_k[k] * mount_k,
                frame: self.expansion_per_k[0] * mount_k,
                body: self.expansion_per_k[1] * body_k,
                gap_m: self.gap_m_per_k[k] * mount_k,
                gain: 1.0 + self.gain_per_k[k] * body_k,
                offset: self.offset_per_k[k] * body_k,
            })
        });
        Assembly { probes }
    }
}

/// The temperature sensors of mount and body: an error for the run, and noise.
#[derive(Debug)]
pub struct TemperatureSensors {
    random: Stream,
    error_k: [f64; 2],
}

impl TemperatureSensors {
    /// The sensors of a run with this number.
    pub fn new(seed: u64, run: u64) -> Self {
        // The coefficients of the stage have the first stream.
        let mut random = Stream::new(seed, Purpose::Thermal, run + 1);
        let error_k = [(); 2].map(|()| random.normal(SENSOR_K));
        Self { random, error_k }
    }

    /// Readings of mount and body at these temperatures (degC), m degC.
    pub fn read_mc(&mut self, celsius: [f64; 2]) -> [i32; 2] {
        [0, 1].map(|k| {
            let read = celsius[k] + self.error_k[k] + self.random.normal(SENSOR_NOISE_K);
            (read * 1e3).round() as i32
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pose::StagePose;
    use hallstage_input::shipped::stage;

    /// Readings of the given day logs, degC: mount and body at the hour.
    #[test]
    fn the_day_is_that_of_the_given_logs() {
        for (hour, mount_c, body_c) in [
            (0.25, 20.60, 23.12),
            (1.0, 21.55, 25.46),
            (2.0, 22.42, 26.13),
            (4.0, 23.55, 27.16),
            (4.5, 23.41, 23.61),
            (5.5, 23.50, 26.75),
            (7.0, 24.81, 28.48),
            (9.0, 25.37, 28.90),
        ] {
            let [mount, body] = Climate::Day { hour: 0.0 }.at(hour * 3600.0);
            let off = [mount - mount_c, body - body_c];
            assert!(off.iter().all(|x| x.abs() < 0.45), "{hour} h: {off:?}");
        }
    }

    /// Remanence and gap with the mount, the element with the body: -0.11 %/K, and 226 per m of 0.4 um/K.
    #[test]
    fn sensitivities_follow_both_temperatures() {
        let slope = |assembly: &Assembly, probe: usize| {
            let at = |u: f64| {
                let mut pose = StagePose::default();
                pose.planar[usize::from(probe != 2)] = u;
                assembly.probes[probe].signal_m(&pose)
            };
            at(1e-4) - at(-1e-4)
        };
        for seed in 0..10 {
            let (assembly, thermal) = (Assembly::draw(&stage(), seed), Thermal::draw(seed));
            for probe in 0..3 {
                let change = |celsius| {
                    let warmed = thermal.warmed(&assembly, celsius);
                    (slope(&warmed, probe) / slope(&assembly, probe) - 1.0) / 5.0
                };
                let k = thermal.remanence_per_k[probe] - 226.0 * thermal.gap_m_per_k[probe];
                let [mount, body] = [[25.0, 20.0], [20.0, 25.0]].map(change);
                // The rest is the expansion: a probe beside the centre line moves across it.
                assert!((mount - k).abs() < 1e-4, "{seed} {probe}: {mount} {k}");
                let h = thermal.gain_per_k[probe];
                assert!((body - h).abs() < 1e-4, "{seed} {probe}: {body} {h}");
            }
        }
    }
}
