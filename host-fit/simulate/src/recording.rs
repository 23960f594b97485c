//! The recording of a run of a simulated stage: codes, beams and the truth.

use super::assembly::Assembly;
use super::dynamics::{Motion, MotionEffects, Moving};
use super::pose::StagePose;
use super::protocol::Run;
use super::random::{Purpose, Stream};
use super::sensors::{ReferenceError, SensorErrors, beams_m, code, gaps_m};
use super::thermal::{Climate, HELD_S, TemperatureSensors, Thermal};
use hallstage_input::dataset::{Dataset, Movement, Row};
use hallstage_input::stage::Stage;
use nalgebra::{Matrix3, Vector3};
use runtime::RawFrame;
use runtime::capacitive::vertical_per_gap;
use runtime::frame::MISSING_CODE;

/// Why a run cannot be simulated.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RecordError {
    /// A probe would hit its magnet.
    #[error(
        "movement {movement}, {t_us} us: probe {probe} would hit its magnet; keep the stage higher or tilt it less"
    )]
    ProbeHitsMagnet {
        /// A, B or C.
        probe: char,
        /// The movement, from 0.
        movement: usize,
        /// Time within it, us.
        t_us: i64,
    },
    /// The stage file has no column for the temperatures.
    #[error(
        "the stage file names no column for a temperature: add [temperature] with mount = \"mount_mc\", \
         body = \"body_mc\" and unit = \"mC\""
    )]
    NoTemperature,
}

/// The readings of one servo period.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sample {
    /// Time within the movement, us.
    pub t_us: i64,
    /// Displacements along the beams X, Y1, Y2, nm.
    pub beams_nm: [i64; 3],
    /// Codes of the gaps 1, 2, 3.
    pub capacitive: [i32; 3],
    /// Hall codes of A, B, C.
    pub hall: [i32; 3],
    /// Temperatures of mount and body, m degC; [`MISSING_CODE`] without a climate.
    pub temperature_mc: [i32; 2],
}

impl Sample {
    /// All codes, as the decoder takes them.
    pub const fn codes(&self, sequence: u32) -> RawFrame {
        RawFrame::new(self.hall, self.capacitive, sequence, self.t_us as u32)
            .with_temperature_mc(self.temperature_mc)
    }
}

/// The log of a run, and the true poses.
#[derive(Clone, Debug, PartialEq)]
pub struct Recording {
    /// The movements, sample after sample.
    pub movements: Vec<Vec<Sample>>,
    /// The true poses.
    pub truth: Vec<Vec<StagePose>>,
}

/// Runs the stage of a seed with the usual errors of the sensors and these effects of motion. With `hour` the run begins at this hour of
/// a working day and records temperatures; [`super::protocol::Protocol::Day`] always does, by default from
/// hour 0.
///
/// # Errors
/// See [`RecordError`].
pub fn record_stage(
    stage: &Stage,
    run: Run,
    hour: Option<f64>,
    dynamics: MotionEffects,
    seed: u64,
) -> Result<Recording, RecordError> {
    let assembly = Assembly::draw(stage, seed);
    let errors = &SensorErrors {
        dynamics,
        ..SensorErrors::USUAL
    };
    match hour.or_else(|| run.spacing_s.map(|_| 0.0)) {
        None => record(stage, &assembly, run, errors, seed),
        Some(_) if stage.temperature.columns == [None, None] => Err(RecordError::NoTemperature),
        Some(hour) => {
            let in_day = (&assembly, &Thermal::draw(seed));
            record_in(stage, in_day, Climate::Day { hour }, run, errors, seed)
        }
    }
}

/// Runs a stage. `seed` is for noise, drift and resets, with a stream for each [`Run::number`]. It may equal
/// the seed of the assembly.
///
/// # Errors
/// [`RecordError::ProbeHitsMagnet`].
pub fn record(
    stage: &Stage,
    assembly: &Assembly,
    run: Run,
    errors: &SensorErrors,
    seed: u64,
) -> Result<Recording, RecordError> {
    record_with(stage, assembly, run, errors, seed, None)
}

/// Runs a stage in a climate: its parts follow the temperature as in [`Thermal`].
///
/// # Errors
/// [`RecordError::ProbeHitsMagnet`].
pub fn record_in(
    stage: &Stage,
    (assembly, thermal): (&Assembly, &Thermal),
    climate: Climate,
    run: Run,
    errors: &SensorErrors,
    seed: u64,
) -> Result<Recording, RecordError> {
    let run = run.in_climate(&climate);
    record_with(stage, assembly, run, errors, seed, Some((thermal, climate)))
}

fn record_with(
    stage: &Stage,
    assembly: &Assembly,
    run: Run,
    errors: &SensorErrors,
    seed: u64,
    climate: Option<(&Thermal, Climate)>,
) -> Result<Recording, RecordError> {
    let mut random = Stream::new(seed, Purpose::Sensors, run.number);
    let mut thermometers = TemperatureSensors::new(seed, run.number);
    let mut movements = Vec::with_capacity(run.movements.len());
    let period_s = stage.servo_period_s;
    let rows_held = (HELD_S / period_s).round().max(1.0) as usize;
    let mut start_s = 0.0;
    for (movement, poses) in run.movements.iter().enumerate() {
        let mut reference = ReferenceError::reset(errors, run.is_zero_exact, period_s, &mut random);
        let mut samples = Vec::with_capacity(poses.len());
        let mut warmed = *assembly;
        let dynamics = (errors.dynamics != MotionEffects::NONE).then_some(&errors.dynamics);
        let mut motions = dynamics.map(|d| [0, 1, 2].map(|probe| Motion::new(d, probe, period_s)));
        let mut temperature_mc = [MISSING_CODE; 2];
        for (k, pose) in poses.iter().enumerate() {
            let t_us = (k as f64 * period_s * 1e6).round() as i64;
            if let (Some((thermal, climate)), 0) = (&climate, k % rows_held) {
                let celsius = climate.at(start_s + k as f64 * period_s);
                warmed = thermal.warmed(assembly, celsius);
                temperature_mc = thermometers.read_mc(celsius);
            }
            let struck = warmed.probes.iter().position(|probe| !probe.is_clear(pose));
            if let Some(probe) = struck {
                return Err(RecordError::ProbeHitsMagnet {
                    probe: ['A', 'B', 'C'][probe],
                    movement,
                    t_us,
                });
            }
            let mut moving = [Moving::at(pose); 3];
            if let Some(motions) = &mut motions {
                for ((moving, motion), probe) in moving.iter_mut().zip(motions).zip(&warmed.probes)
                {
                    *moving = motion.next(poses, k, probe.place_m());
                }
            }
            let error = reference.next(&mut random);
            let shown = StagePose {
                planar: core::array::from_fn(|i| pose.planar[i] + error[i]),
                ..*pose
            };
            let mut noisy = |value: f64, deviation: f64| value + random.normal(deviation);
            samples.push(Sample {
                t_us,
                beams_nm: beams_m(stage, &shown)
                    .map(|beam| (noisy(beam, errors.beam_m) * 1e9).round() as i64),
                capacitive: gaps_m(stage, pose)
                    .map(|gap| code(noisy(gap, errors.gap_m), &stage.capacitive)),
                hall: [0, 1, 2].map(|probe| {
                    let signal_m = warmed.probes[probe].moving_signal_m(&moving[probe]);
                    code(noisy(signal_m, errors.hall_m), &stage.hall)
                }),
                temperature_mc,
            });
        }
        start_s += run.spacing_s.unwrap_or(poses.len() as f64 * period_s);
        movements.push(samples);
    }
    Ok(Recording {
        movements,
        truth: run.movements,
    })
}

impl Recording {
    /// The number of samples.
    pub fn rows(&self) -> usize {
        self.movements.iter().map(Vec::len).sum()
    }

    /// The log as the fit reads it from [`super::log_text::log_csv`], without the hash of a file. `None` if
    /// the capacitive sensors stand in one line; a checked stage never has that.
    pub fn dataset(&self, stage: &Stage) -> Option<Dataset> {
        Self::joined(&[self], stage)
    }

    /// The log with the true poses as its reference.
    pub fn dataset_with_truth(&self, stage: &Stage) -> Option<Dataset> {
        let mut dataset = self.dataset(stage)?;
        for (row, truth) in dataset.rows.iter_mut().zip(self.truth.iter().flatten()) {
            row.reference = truth.planar;
        }
        Some(dataset)
    }

    /// Several logs read together.
    pub fn joined(logs: &[&Self], stage: &Stage) -> Option<Dataset> {
        let per_gap = vertical_per_gap(&stage.capacitive_probes_m)?;
        let mut dataset = Dataset::default();
        for (log, recording) in logs.iter().enumerate() {
            for (index, samples) in (0..).zip(&recording.movements) {
                let (start, movement) = (dataset.rows.len(), dataset.movements.len());
                let rows = (0..).zip(samples);
                let rows = rows.map(|(k, sample)| row(stage, &per_gap, movement, k, sample));
                dataset.rows.extend(rows);
                dataset.movements.push(Movement {
                    log,
                    index,
                    rows: start..dataset.rows.len(),
                });
            }
            dataset.end_log("simulated");
        }
        dataset.compensate_as_expected(&stage.temperature);
        Some(dataset)
    }
}

fn row(stage: &Stage, per_gap: &Matrix3<f64>, movement: usize, sequence: u32, s: &Sample) -> Row {
    let gaps = (s.capacitive).map(|code| f64::from(code) * stage.capacitive.m_per_count);
    let vertical = (per_gap * Vector3::from(gaps)).into();
    let beams_m = s.beams_nm.map(|nm| nm as f64 * 1e-9);
    Row {
        movement,
        t_us: s.t_us,
        frame: s.codes(sequence).into(),
        signal_m: s.hall.map(|code| f64::from(code) * stage.hall.m_per_count),
        vertical,
        reference: stage.interferometer.pose(beams_m, vertical),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log_text::log_csv;
    use crate::protocol::Protocol;
    use hallstage_input::log::{ReadOptions, read_bytes};
    use hallstage_input::shipped::stage;
    use sha2::{Digest, Sha256};

    fn short(protocol: Protocol, errors: &SensorErrors, seed: u64) -> Recording {
        let stage = stage();
        let mut run = protocol.run(stage.servo_period_s, seed);
        run.movements.truncate(3);
        run.movements
            .iter_mut()
            .for_each(|poses| poses.truncate(300));
        record(&stage, &Assembly::draw(&stage, seed), run, errors, seed).expect("clear")
    }

    #[test]
    fn the_dataset_is_what_reading_the_log_gives() {
        let recording = short(Protocol::Combined, &SensorErrors::USUAL, 1);
        let csv = log_csv(&recording, &stage());
        let options = ReadOptions::default();
        let read = read_bytes(csv.as_bytes(), "simulated".as_ref(), &stage(), &options);
        let read = read.expect("a sound log");
        assert_eq!(read.warnings, []);
        let mut dataset = recording.dataset(&stage()).expect("a triangle");
        // It has no text.
        dataset.logs[0].sha256 = read.dataset.logs[0].sha256;
        assert_eq!(
            (&dataset.movements, &dataset.logs),
            (&read.dataset.movements, &read.dataset.logs)
        );
        assert_eq!(dataset.rows, read.dataset.rows);
    }

    /// The hash of the same log from an optimised program: a change of it changes every log.
    #[test]
    fn a_seed_gives_the_same_bytes_at_every_optimisation_level() {
        let stage = stage();
        let run = Protocol::Combined.run(stage.servo_period_s, 1);
        let assembly = Assembly::draw(&stage, 1);
        let recording = record(&stage, &assembly, run, &SensorErrors::USUAL, 1).expect("clear");
        let hash = Sha256::digest(log_csv(&recording, &stage));
        let want = "b68e5114b4fc9b91d3410f804fcf13e760b919ea2577fd438b004b1c084b6868";
        let have: String = hash.iter().map(|byte| format!("{byte:02x}")).collect();
        assert_eq!(have, want);
    }

    #[test]
    fn a_run_that_drives_a_probe_into_its_magnet_is_refused() {
        let stage = stage();
        let low = StagePose::from_array([0.0, 0.0, 0.0, -8e-3, 0.0, 0.0]);
        let run = Run::planned(vec![StagePose::default(), low]);
        let assembly = Assembly::draw(&stage, 1);
        let error = record(&stage, &assembly, run, &SensorErrors::USUAL, 1).expect_err("too low");
        let hit = RecordError::ProbeHitsMagnet {
            probe: 'A',
            movement: 0,
            t_us: 2000,
        };
        assert_eq!(error, hit);
    }
}
