//! The diagnosis of simulated logs: warnings on 200 clean stages, mistakes and faults that it names, and
//! the predicted errors in service.
//!
//! Prints tables and `RESULT key=value` lines.

#[path = "../common/mod.rs"]
mod common;
mod faults;
mod paper;

use common::{Twin, dataset};
use host_fit::calibration::diagnose::diagnose_log;
use host_fit::calibration::diagnose::structure::structure;
use host_fit::calibration::fit::{FitError, FitSettings, ModelChoice, fit};
use host_fit::calibration::plan::plan;
use host_fit::calibration::words::message;
use host_fit::input::dataset::Dataset;
use host_fit::input::finding::{Code, Finding, Severity};
use host_fit::input::shipped;
use host_fit::input::stage::Stage;
use host_fit::simulate::protocol::{Protocol, Run, Trajectory};
use host_fit::simulate::recording::{Recording, Sample, record};
use host_fit::simulate::sensors::SensorErrors;

/// Number of clean stages. Each has one of the three kinds of log.
const CLEAN: u64 = 200;
/// Number of stages for each mistake, again with the three kinds in turn.
const FAULTY: u64 = 12;

fn main() {
    let stage = shipped::stage();
    let planned = plan(&stage, 20.0).expect("a plan").run;
    let planned = planned.trajectory(stage.servo_period_s);
    faults::table(&stage, &planned, 2000..2004);
    clean(&stage, &planned);
    println!("{:<36}{:>9}", "mistake", "named");
    for (title, code, mistake) in MISTAKES {
        let found = (1..=FAULTY).map(|seed| {
            let mut recording = recording(&stage, &planned, 1000 + seed);
            recording.movements.iter_mut().flatten().for_each(mistake);
            let mut found =
                structure(&dataset(&recording, &stage), &stage, false, None).into_iter();
            found.any(|finding| finding.code() == code)
        });
        let named = found.filter(|is_named| *is_named).count();
        println!("{title:<36}{named:>6}/{FAULTY}");
    }
    paper::table(&stage, 7000..7024);
}

/// The warnings and refusals of `fit` for a log, and the error of the fit.
fn grave(dataset: &Dataset, stage: &Stage) -> (Vec<Finding>, Option<FitError>) {
    let fitted = fit(dataset, stage, &FitSettings::new(ModelChoice::Auto));
    let mut found = diagnose_log(dataset, stage, fitted.as_ref()).findings;
    found.retain(|finding| finding.severity > Severity::Note);
    (found, fitted.err())
}

/// Counts the clean stages with a warning.
fn clean(stage: &Stage, planned: &Trajectory) {
    let mut warned = 0;
    for seed in 1..=CLEAN {
        let log = dataset(&recording(stage, planned, seed), stage);
        let (grave, error) = grave(&log, stage);
        for found in &grave {
            println!("clean stage {seed}: {:?}: {}", found.code(), message(found));
        }
        if let Some(error) = &error {
            println!("clean stage {seed}: {error}");
        }
        warned += u64::from(!grave.is_empty() || error.is_some());
    }
    println!("RESULT clean_stages={CLEAN}");
    println!("RESULT clean_stages_warned={warned}");
}

/// A recording of the stage of a seed: by the paper's protocol, combined or planned.
fn recording(stage: &Stage, planned: &Trajectory, seed: u64) -> Recording {
    Twin::new(stage, seed).record(match seed % 3 {
        0 => Protocol::Paper.run(stage.servo_period_s, seed),
        1 => Protocol::Combined.run(stage.servo_period_s, seed),
        _ => Run::planned(planned.clone()),
    })
}

/// Service of a stage with an exact reference.
fn service(twin: &Twin) -> Recording {
    let quiet = SensorErrors {
        drift_per_root_s: [0.0; 3],
        beam_m: 0.0,
        ..SensorErrors::USUAL
    };
    let seed = twin.seed + 500;
    let run = Protocol::Service.run(twin.stage.servo_period_s, seed);
    record(twin.stage, &twin.assembly, run, &quiet, seed).expect("clear")
}

/// A mistake of a laboratory, and the code of its finding.
type Mistake = (&'static str, Code, fn(&mut Sample));

#[rustfmt::skip]
const MISTAKES: [Mistake; 26] = [
    ("Hall A and B exchanged", Code::ChannelsSwapped, |s| s.hall.swap(0, 1)),
    ("Hall A and C exchanged", Code::ChannelsSwapped, |s| s.hall.swap(0, 2)),
    ("Hall B and C exchanged", Code::ChannelsSwapped, |s| s.hall.swap(1, 2)),
    ("Hall A turned", Code::ChannelInverted, |s| s.hall[0] *= -1),
    ("Hall B turned", Code::ChannelInverted, |s| s.hall[1] *= -1),
    ("Hall C turned", Code::ChannelInverted, |s| s.hall[2] *= -1),
    ("Hall A, B, C turned", Code::ChannelInverted, |s| s.hall = s.hall.map(|code| -code)),
    ("beams Y1 and Y2 exchanged", Code::BeamsSwapped, |s| s.beams_nm.swap(1, 2)),
    ("beams X and Y1 exchanged", Code::BeamsSwapped, |s| s.beams_nm.swap(0, 1)),
    ("beam X turned", Code::BeamInverted, |s| s.beams_nm[0] *= -1),
    ("beam Y2 turned", Code::BeamInverted, |s| s.beams_nm[2] *= -1),
    ("capacitive 1 and 2 exchanged", Code::CapacitiveSwapped, |s| s.capacitive.swap(0, 1)),
    ("capacitive 1 and 3 exchanged", Code::CapacitiveSwapped, |s| s.capacitive.swap(0, 2)),
    ("capacitive 2 and 3 exchanged", Code::CapacitiveSwapped, |s| s.capacitive.swap(1, 2)),
    ("capacitive 1 turned", Code::CapacitiveInverted, |s| s.capacitive[0] *= -1),
    ("capacitive 3 turned", Code::CapacitiveInverted, |s| s.capacitive[2] *= -1),
    ("Hall A x 2", Code::ScaleWrong, |s| s.hall[0] *= 2),
    ("Hall C x 0.5", Code::ScaleWrong, |s| s.hall[2] /= 2),
    ("beam X x 0.5", Code::ScaleWrong, |s| s.beams_nm[0] /= 2),
    ("beam Y1 x 1.1", Code::ScaleWrong, |s| s.beams_nm[1] += s.beams_nm[1] / 10),
    ("beam Y2 x 0.8", Code::ScaleWrong, |s| s.beams_nm[2] -= s.beams_nm[2] / 5),
    ("reference x 2", Code::ScaleWrong, |s| s.beams_nm = s.beams_nm.map(|nm| 2 * nm)),
    ("capacitive 1 x 1.2", Code::ScaleWrong, |s| s.capacitive[0] += s.capacitive[0] / 5),
    ("capacitive 2 x 0.5", Code::ScaleWrong, |s| s.capacitive[1] /= 2),
    ("capacitive 1, 2, 3 x 0.1", Code::ScaleWrong, |s| s.capacitive = s.capacitive.map(|code| code / 10)),
    ("capacitive 1, 2, 3 turned", Code::CapacitiveInverted, |s| s.capacitive = s.capacitive.map(|code| -code)),
];
