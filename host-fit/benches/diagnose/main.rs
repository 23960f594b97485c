//! What the diagnosis says of simulated logs: of 200 clean stages how many it warns of, and of logs
//! with a mistake or a fault how many it names.
//!
//! Prints a table and `RESULT key=value` lines.

mod faults;
mod signals;

use host_fit::diagnose;
use host_fit::finding::{Code, Finding, Severity};
use host_fit::fit::{FitSettings, ModelChoice, fit};
use host_fit::input::dataset::{Dataset, Movement, Row};
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
    println!("{:<36}{:>9}{:>9}", "mistake", "refused", "named");
    for (name, code, mistake) in mistakes() {
        let recordings = (1..=FAULTY).map(|seed| recording(&stage, &planned, 1000 + seed));
        let found = recordings.map(|mut recording| {
            for sample in recording.movements.iter_mut().flatten() {
                mistake(sample);
            }
            let dataset = recording.dataset(&stage).expect("a plane");
            diagnose::structure::structure(&dataset, &stage)
        });
        tell(name, code, &found.map(Vec::from_iter).collect::<Vec<_>>());
    }
    for (name, code, from, to) in STAGE_MISTAKES {
        let toml = STAGE_TOML.replacen(from, to, 1);
        assert!(toml != STAGE_TOML, "{from}");
        let wrong = Stage::from_toml(&toml, Path::new("stage.toml")).expect("readable");
        let found = (1..=FAULTY).map(|seed| {
            let recording = recording(&stage, &planned, 1000 + seed);
            let dataset = recording.dataset(&wrong).expect("a plane");
            diagnose::structure::structure(&dataset, &wrong)
        });
        tell(name, code, &found.map(Vec::from_iter).collect::<Vec<_>>());
    }
    for percent in [0.0, 1.0, 1.5, 2.0, 3.0, 5.0] {
        let found = (1..=FAULTY).map(|seed| {
            let first = recording(&stage, &planned, 1000 + seed);
            let mut second = recording_of(&stage, &planned, 1000 + seed, seed + 1);
            for sample in second.movements.iter_mut().flatten() {
                sample.hall = sample
                    .hall
                    .map(|code| (f64::from(code) * (1.0 + percent / 100.0)).round() as i32);
            }
            let logs = [first, second].map(|r| r.dataset(&stage).expect("a plane"));
            of_fit(&joined(logs), &stage)
        });
        let found: Vec<_> = found.collect();
        tell(
            &format!("two logs, gain {percent} %"),
            Code::LogsDisagree,
            &found,
        );
    }
    let found = (1..=FAULTY).map(|seed| {
        let logs = [seed, seed + FAULTY].map(|seed| recording(&stage, &planned, 1000 + seed));
        let logs = logs.map(|r| r.dataset(&stage).expect("a plane"));
        of_fit(&joined(logs), &stage)
    });
    tell("two stages", Code::LogsDisagree, &found.collect::<Vec<_>>());
    let found = (1..=FAULTY).map(|seed| {
        // A planned run is one movement.
        let logs =
            [seed, seed + FAULTY].map(|n| recording_of(&stage, &planned, 1000 + n, seed % 2));
        let [mut mixed, second] = logs;
        let half = mixed.movements.len() / 2;
        mixed.movements[half..].clone_from_slice(&second.movements[half..]);
        let dataset = mixed.dataset(&stage).expect("a plane");
        of_fit(&dataset, &stage)
    });
    let name = "two stages in one log";
    tell(name, Code::LogsDisagree, &found.collect::<Vec<_>>());
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

fn tell(name: &str, code: Code, found: &[Vec<Finding>]) {
    let count = |wanted: &dyn Fn(&Finding) -> bool| {
        let hits = found.iter().filter(|findings| findings.iter().any(wanted));
        hits.count()
    };
    let refused = count(&|finding| finding.severity == Severity::Refuse);
    let named = count(&|finding| finding.code == code);
    println!("{name:<36}{refused:>6}/{FAULTY}{named:>6}/{FAULTY}");
    let key = name.replace([' ', ',', '%', '+', '-'], "_");
    println!("RESULT named_{key}={:.3}", named as f64 / FAULTY as f64);
}

/// A log of the stage of a seed: by the paper's protocol, combined or planned.
fn recording(stage: &Stage, planned: &Trajectory, seed: u64) -> Recording {
    recording_of(stage, planned, seed, seed)
}

fn recording_of(stage: &Stage, planned: &Trajectory, seed: u64, kind: u64) -> Recording {
    let run = match kind % 3 {
        0 => Protocol::Paper.run(stage.servo_period_s, seed),
        1 => Protocol::Combined.run(stage.servo_period_s, seed),
        _ => Run::planned(planned.clone()),
    };
    let assembly = Assembly::draw(stage, seed);
    let recording = record(stage, &assembly, run, &SensorErrors::USUAL, seed);
    recording.expect("no probe hits its magnet")
}

/// Two logs as one dataset.
fn joined([mut first, second]: [Dataset; 2]) -> Dataset {
    let (rows, movements) = (first.rows.len(), first.movements.len());
    first.rows.extend(second.rows.iter().map(|row| Row {
        movement: row.movement + movements,
        ..*row
    }));
    first
        .movements
        .extend(second.movements.iter().map(|movement| Movement {
            log: 1,
            rows: movement.rows.start + rows..movement.rows.end + rows,
            ..movement.clone()
        }));
    first.end_log("second");
    first
}

type Mistake = (&'static str, Code, fn(&mut Sample));

fn mistakes() -> [Mistake; 22] {
    [
        ("hall a and b exchanged", Code::ChannelsSwapped, |s| {
            s.hall.swap(0, 1)
        }),
        ("hall a and c exchanged", Code::ChannelsSwapped, |s| {
            s.hall.swap(0, 2)
        }),
        ("hall b and c exchanged", Code::ChannelsSwapped, |s| {
            s.hall.swap(1, 2)
        }),
        ("hall a b c in a ring", Code::ChannelsSwapped, |s| {
            s.hall.rotate_left(1)
        }),
        ("hall a turned", Code::ChannelInverted, |s| {
            s.hall[0] = -s.hall[0]
        }),
        ("hall b turned", Code::ChannelInverted, |s| {
            s.hall[1] = -s.hall[1]
        }),
        ("hall c turned", Code::ChannelInverted, |s| {
            s.hall[2] = -s.hall[2]
        }),
        ("all hall turned", Code::ChannelInverted, |s| {
            s.hall = s.hall.map(|code| -code)
        }),
        ("y1 and y2 exchanged", Code::BeamsSwapped, |s| {
            s.beams_nm.swap(1, 2)
        }),
        ("x and y1 exchanged", Code::BeamsSwapped, |s| {
            s.beams_nm.swap(0, 1)
        }),
        ("x turned", Code::BeamInverted, |s| {
            s.beams_nm[0] = -s.beams_nm[0]
        }),
        ("y2 turned", Code::BeamInverted, |s| {
            s.beams_nm[2] = -s.beams_nm[2]
        }),
        (
            "capacitive 1 and 2 exchanged",
            Code::CapacitiveSwapped,
            |s| s.capacitive.swap(0, 1),
        ),
        (
            "capacitive 1 and 3 exchanged",
            Code::CapacitiveSwapped,
            |s| s.capacitive.swap(0, 2),
        ),
        (
            "capacitive 2 and 3 exchanged",
            Code::CapacitiveSwapped,
            |s| s.capacitive.swap(1, 2),
        ),
        ("all capacitive turned", Code::CapacitiveInverted, |s| {
            s.capacitive = s.capacitive.map(|code| -code);
        }),
        ("capacitive 1 turned", Code::CapacitiveInverted, |s| {
            s.capacitive[0] = -s.capacitive[0]
        }),
        ("capacitive 3 turned", Code::CapacitiveInverted, |s| {
            s.capacitive[2] = -s.capacitive[2]
        }),
        ("reference / 1000", Code::ScaleWrong, |s| {
            s.beams_nm = s.beams_nm.map(|nm| (nm as f64 / 1000.0).round() as i64);
        }),
        ("reference * 1000", Code::ScaleWrong, |s| {
            s.beams_nm = s.beams_nm.map(|nm| nm * 1000)
        }),
        ("reset 50 um off", Code::ZeroClipped, |s| {
            s.beams_nm = s.beams_nm.map(|nm| nm + 50_000)
        }),
        ("reset 20 um off", Code::ZeroClipped, |s| {
            s.beams_nm = s.beams_nm.map(|nm| nm + 20_000)
        }),
    ]
}

/// Name, code, what stands in `stage.toml`, what is written instead.
const STAGE_MISTAKES: [(&str, Code, &str, &str); 6] = [
    (
        "place of sensor 3 turned",
        Code::CapacitiveInverted,
        "[0.0, -0.12]]",
        "[0.0, 0.12]]",
    ),
    (
        "hall scale * 2",
        Code::ScaleWrong,
        "m_per_count = 6.25e-8",
        "m_per_count = 12.5e-8",
    ),
    (
        "hall scale * 1.5",
        Code::ScaleWrong,
        "m_per_count = 6.25e-8",
        "m_per_count = 9.375e-8",
    ),
    (
        "hall scale / 2",
        Code::ScaleWrong,
        "m_per_count = 6.25e-8",
        "m_per_count = 3.125e-8",
    ),
    (
        "baseline * 2",
        Code::ScaleWrong,
        "y_baseline_m = 0.10",
        "y_baseline_m = 0.20",
    ),
    (
        "baseline / 2",
        Code::ScaleWrong,
        "y_baseline_m = 0.10",
        "y_baseline_m = 0.05",
    ),
];
