//! What the diagnosis says of simulated logs: of 200 clean stages how many it warns of, and of logs
//! with a mistake or a fault how many it names; of logs of the paper what is predicted of service.
//!
//! Prints a table and `RESULT key=value` lines.

mod faults;
mod paper;
mod signals;

use host_fit::diagnose;
use host_fit::finding::{Code, Finding, Severity};
use host_fit::fit::{FitSettings, ModelChoice, fit};
use host_fit::input::dataset::Dataset;
use host_fit::input::shipped::STAGE_TOML;
use host_fit::input::stage::Stage;
use host_fit::plan::plan;
use host_fit::simulate::assembly::Assembly;
use host_fit::simulate::protocol::{Protocol, Run, Trajectory};
use host_fit::simulate::recording::{Recording, Sample, record};
use host_fit::simulate::sensors::SensorErrors;
use std::path::Path;

/// Clean stages: each makes one of the three kinds of log.
const CLEAN: u64 = 200;
/// Stages that each mistake is made on, again with the three kinds in turn.
const FAULTY: u64 = 12;

fn main() {
    let stage = Stage::from_toml(STAGE_TOML, Path::new("stage.toml")).expect("a sound stage");
    let planned = plan(&stage, 20.0).expect("a plan").run;
    let planned = planned.trajectory(stage.servo_period_s);
    clean(&stage, &planned);
    println!("{:<36}{:>9}", "mistake", "named");
    for (channels, change) in MISTAKES {
        let found = (1..=FAULTY).map(|seed| {
            let mut recording = recording(&stage, &planned, 1000 + seed);
            let samples = recording.movements.iter_mut().flatten();
            samples.for_each(|sample| change.make(channels, sample));
            let dataset = recording.dataset(&stage).expect("a plane");
            let mut found = diagnose::structure::structure(&dataset, &stage).into_iter();
            found.any(|finding| finding.code == change.code(channels))
        });
        let named = found.filter(|is_named| *is_named).count();
        println!(
            "{:<36}{named:>6}/{FAULTY}",
            format!("{channels:?} {change:?}")
        );
    }
    paper::table(&stage, 7000..7024);
    faults::table(&stage, &planned, 2000..2004);
    signals::table(&stage, &planned);
}

/// All findings of a log, as `fit` gives them.
fn of_fit(dataset: &Dataset, stage: &Stage) -> Vec<Finding> {
    let fitted = fit(dataset, stage, &FitSettings::new(ModelChoice::Auto));
    diagnose::of_log(dataset, stage, fitted.as_ref()).findings
}

/// Findings above a note on clean stages.
fn clean(stage: &Stage, planned: &Trajectory) {
    let mut warned = 0;
    for seed in 1..=CLEAN {
        let recording = recording(stage, planned, seed);
        let dataset = recording.dataset(stage).expect("a plane");
        let settings = FitSettings::new(ModelChoice::Auto);
        let fitted = fit(&dataset, stage, &settings);
        let found = diagnose::of_log(&dataset, stage, fitted.as_ref()).findings;
        let grave: Vec<_> = (found.iter())
            .filter(|finding| finding.severity > Severity::Note)
            .collect();
        for finding in &grave {
            println!(
                "clean stage {seed}: {:?}: {}",
                finding.code, finding.message
            );
        }
        if let Err(error) = &fitted {
            println!("clean stage {seed}: {error}");
        }
        warned += u64::from(!grave.is_empty() || fitted.is_err());
    }
    println!("RESULT clean_stages={CLEAN}");
    println!("RESULT clean_stages_warned={warned}");
}

/// A log of the stage of a seed: by the paper's protocol, combined or planned.
fn recording(stage: &Stage, planned: &Trajectory, seed: u64) -> Recording {
    let run = match seed % 3 {
        0 => Protocol::Paper.run(stage.servo_period_s, seed),
        1 => Protocol::Combined.run(stage.servo_period_s, seed),
        _ => Run::planned(planned.clone()),
    };
    let assembly = Assembly::draw(stage, seed);
    let recording = record(stage, &assembly, run, &SensorErrors::USUAL, seed);
    recording.expect("no probe hits its magnet")
}

#[derive(Clone, Copy, Debug)]
enum Channels {
    Hall,
    Beams,
    Capacitive,
}

/// What a laboratory does to channels, by their places.
#[derive(Clone, Copy, Debug)]
enum Change {
    Exchanged(usize, usize),
    Turned(&'static [usize]),
}

use Change::{Exchanged, Turned};
use Channels::{Beams, Capacitive, Hall};

const MISTAKES: [(Channels, Change); 17] = [
    (Hall, Exchanged(0, 1)),
    (Hall, Exchanged(0, 2)),
    (Hall, Exchanged(1, 2)),
    (Hall, Turned(&[0])),
    (Hall, Turned(&[1])),
    (Hall, Turned(&[2])),
    (Hall, Turned(&[0, 1, 2])),
    (Beams, Exchanged(1, 2)),
    (Beams, Exchanged(0, 1)),
    (Beams, Turned(&[0])),
    (Beams, Turned(&[2])),
    (Capacitive, Exchanged(0, 1)),
    (Capacitive, Exchanged(0, 2)),
    (Capacitive, Exchanged(1, 2)),
    (Capacitive, Turned(&[0])),
    (Capacitive, Turned(&[2])),
    (Capacitive, Turned(&[0, 1, 2])),
];

impl Change {
    fn make(self, channels: Channels, sample: &mut Sample) {
        match (self, channels) {
            (Exchanged(a, b), Hall) => sample.hall.swap(a, b),
            (Exchanged(a, b), Beams) => sample.beams_nm.swap(a, b),
            (Exchanged(a, b), Capacitive) => sample.capacitive.swap(a, b),
            (Turned(of), Hall) => of.iter().for_each(|k| sample.hall[*k] *= -1),
            (Turned(of), Beams) => of.iter().for_each(|k| sample.beams_nm[*k] *= -1),
            (Turned(of), Capacitive) => of.iter().for_each(|k| sample.capacitive[*k] *= -1),
        }
    }

    /// What names it.
    const fn code(self, channels: Channels) -> Code {
        match (self, channels) {
            (Exchanged(..), Hall) => Code::ChannelsSwapped,
            (Exchanged(..), Beams) => Code::BeamsSwapped,
            (Exchanged(..), Capacitive) => Code::CapacitiveSwapped,
            (Turned(_), Hall) => Code::ChannelInverted,
            (Turned(_), Beams) => Code::BeamInverted,
            (Turned(_), Capacitive) => Code::CapacitiveInverted,
        }
    }
}
