//! Faults of channels in simulated logs: predicted errors, true errors in service, and the errors of the
//! repaired calibration.

use crate::common::{Twin, dataset, rms};
use crate::service;
use host_fit::calibration::diagnose::diagnose_log;
use host_fit::calibration::fit::{FitSettings, ModelChoice, fit};
use host_fit::calibration::judge::verdict::Verdict;
use host_fit::input::dataset::Dataset;
use host_fit::input::finding::Severity;
use host_fit::input::stage::Stage;
use host_fit::simulate::protocol::{Protocol, Run, Trajectory};
use host_fit::simulate::recording::Sample;
use host_fit::solver::estimator::parameters::FieldParameters;
use runtime::ParameterSet;

/// A name, whether the fault stays in service, and the change of a sample: at a share of the log, and by its
/// number.
type Fault = (&'static str, bool, fn(&mut Sample, f64, usize, &Stage));

fn gain(code: &mut i32, percent: f64) {
    *code = (f64::from(*code) * (1.0 + percent / 100.0)).round() as i32;
}

fn hall(sample: &mut Sample, stage: &Stage, probe: usize, um: f64) {
    sample.hall[probe] += (um * 1e-6 / stage.hall.m_per_count).round() as i32;
}

fn gap(sample: &mut Sample, stage: &Stage, gap: usize, um: f64) {
    sample.capacitive[gap] += (um * 1e-6 / stage.capacitive.m_per_count).round() as i32;
}

#[rustfmt::skip]
const FAULTS: [Fault; 27] = [
    ("Hall B gain .2 %", true, |s, t, _, _| if t > 0.47 { gain(&mut s.hall[1], 0.2) }),
    ("Hall B gain .5 %", true, |s, t, _, _| if t > 0.47 { gain(&mut s.hall[1], 0.5) }),
    ("Hall A gain 1 %", true, |s, t, _, _| if t > 0.6 { gain(&mut s.hall[0], 1.0) }),
    ("Hall C gain -2 %", true, |s, t, _, _| if t > 0.35 { gain(&mut s.hall[2], -2.0) }),
    ("all Halls -1 %", true, |s, t, _, _| if t > 0.5 { s.hall.iter_mut().for_each(|c| gain(c, -1.0)) }),
    ("gain ramp C .5 %", true, |s, t, _, _| gain(&mut s.hall[2], 0.5 * t)),
    ("gain ramp C 3 %", true, |s, t, _, _| gain(&mut s.hall[2], 3.0 * t)),
    ("gain A up and back 2 %", false, |s, t, _, _| if (0.3..0.6).contains(&t) { gain(&mut s.hall[0], 2.0) }),
    ("beam Y1 step 2 um", false, |s, t, _, _| if t > 0.53 { s.beams_nm[1] += 2_000 }),
    ("beam Y1 step 5 um", false, |s, t, _, _| if t > 0.53 { s.beams_nm[1] += 5_000 }),
    ("beam X step 10 um", false, |s, t, _, _| if t > 0.33 { s.beams_nm[0] += 10_000 }),
    ("beam Y2 step 25 um", false, |s, t, _, _| if t > 0.71 { s.beams_nm[2] += 25_000 }),
    ("Hall A step 5 um", false, |s, t, _, g| if t > 0.4 { hall(s, g, 0, 5.0) }),
    ("Hall C step 25 um", false, |s, t, _, g| if t > 0.61 { hall(s, g, 2, 25.0) }),
    ("capacitive 2 step 10 um", true, |s, t, _, g| if t > 0.5 { gap(s, g, 1, 10.0) }),
    ("capacitive 3 step 2 um", true, |s, t, _, g| if t > 0.4 { gap(s, g, 2, 2.0) }),
    ("capacitive 1 gain 2 %", true, |s, t, _, _| if t > 0.5 { gain(&mut s.capacitive[0], 2.0) }),
    ("capacitive 3 gain .5 %", true, |s, t, _, _| if t > 0.5 { gain(&mut s.capacitive[2], 0.5) }),
    ("drift A .1 um/s", false, |s, t, _, g| hall(s, g, 0, 2.0 * t)),
    ("drift B 1 um/s", false, |s, t, _, g| hall(s, g, 1, 20.0 * t)),
    ("hum 50 Hz 3 um B", false, |s, _, n, g| hall(s, g, 1, 3.0 * (n as f64 * 0.628_318_53).sin())),
    ("hum 7 Hz 2 um A", false, |s, _, n, g| hall(s, g, 0, 2.0 * (n as f64 * 0.087_964_59).sin())),
    ("outliers 1 % A 50 um", false, |s, _, n, g| if n % 100 == 37 { hall(s, g, 0, 50.0) }),
    ("outliers .1 % X 200 um", false, |s, _, n, _| if n % 1000 == 37 { s.beams_nm[0] += 200_000 }),
    ("beams 1 % longer", false, |s, t, _, _| if t > 0.5 { s.beams_nm = s.beams_nm.map(|nm| nm + nm / 100) }),
    ("gain .1 % and gap 3 um", true, |s, t, _, g| if t > 0.5 { gain(&mut s.hall[2], 0.1); gap(s, g, 0, 3.0) }),
    ("Hall noise x 2", false, |s, _, n, g| hall(s, g, 2, 0.87 * (((n * 7919) % 1000) as f64 / 500.0 - 1.0))),
];

/// Errors of a blob in service over the noise floor, worst axis.
fn ratio(set: &ParameterSet, service: &Dataset, stage: &Stage, floor: [f64; 3]) -> f64 {
    let errors = rms(set, service, stage);
    (0..3).map(|k| errors[k] / floor[k]).fold(0.0, f64::max)
}

/// The result of one fault.
struct Outcome {
    is_near: bool,
    is_class: bool,
    is_good: bool,
    truth: f64,
    repaired: Option<f64>,
}

/// Prints the table of faults, then the score.
pub fn table(stage: &Stage, planned: &Trajectory, seeds: std::ops::Range<u64>) {
    println!(
        "{:<26}{:>9}{:>9}{:>9}{:>9}  class, verdict",
        "fault", "predicted", "true", "repaired", "true"
    );
    let mut all: Vec<Outcome> = Vec::new();
    for seed in seeds {
        let run = match seed % 2 {
            0 => Protocol::Combined.run(stage.servo_period_s, seed),
            _ => Run::planned(planned.clone()),
        };
        let twin = Twin::new(stage, seed);
        let (clean, service) = (twin.record(run), service(&twin));
        let settings = FitSettings {
            force: true,
            ..FitSettings::new(ModelChoice::Auto)
        };
        let fitted = fit(&dataset(&clean, stage), stage, &settings).expect("a fit");
        let floor = rms(&fitted.set, &dataset(&service, stage), stage);
        for (name, is_lasting, fault) in FAULTS {
            let rows = clean.rows() as f64;
            let mut faulty = clean.clone();
            for (n, sample) in faulty.movements.iter_mut().flatten().enumerate() {
                fault(sample, n as f64 / rows, n, stage);
            }
            let mut in_service = service.clone();
            if is_lasting {
                for sample in in_service.movements.iter_mut().flatten() {
                    fault(sample, 1.0, 0, stage);
                }
            }
            let in_service = dataset(&in_service, stage);
            let log = dataset(&faulty, stage);
            let fitted = fit(&log, stage, &settings);
            let diagnosis = diagnose_log(&log, stage, fitted.as_ref());
            let Ok(fitted) = fitted else {
                println!("{name:<26} no fit");
                continue;
            };
            let truth = ratio(&fitted.set, &in_service, stage, floor);
            let expected = diagnosis.predicted.map_or(f64::NAN, |p| p.worst_ratio());
            let costs = diagnosis.findings.iter().filter_map(|found| found.cost);
            let cost = costs.fold(1.0, f64::max);
            let repaired = diagnosis.repair.as_ref().map(|repair| {
                let constants =
                    |parameters: &FieldParameters| parameters.constants(stage.hall.m_per_count);
                let mut calibration = fitted.calibration.clone();
                calibration.geometry = repair.parameters.model_31().geometry();
                let probes = constants(&repair.parameters).expect("sound").probes;
                calibration.probes = runtime::model::Probes::Field(probes);
                let set = calibration.prepare(&Default::default()).expect("sound");
                ratio(&set, &in_service, stage, floor)
            });
            let predicted = if repaired.is_some() { cost } else { expected };
            let class = |ratio: f64| match ratio {
                ratio if ratio < 1.05 => Severity::Note,
                ratio if ratio < 1.3 => Severity::Warn,
                _ => Severity::Refuse,
            };
            let is_near =
                (predicted / truth - 1.0).abs() < 0.15 || (predicted - truth).abs() < 0.05;
            let is_class = class(predicted) == class(truth);
            all.push(Outcome {
                is_near,
                is_class,
                is_good: diagnosis.verdict == Some(Verdict::Good),
                truth,
                repaired,
            });
            let shown = |x: Option<f64>| x.map_or("-".to_owned(), |x| format!("{x:.3}"));
            println!(
                "{name:<26}{predicted:>9.3}{truth:>9.3}{:>9}{:>9}  {}{} {:?}",
                shown(repaired.map(|_| expected)),
                shown(repaired),
                if is_near { "" } else { "FAR " },
                if is_class { "right" } else { "WRONG" },
                diagnosis.verdict.expect("a verdict"),
            );
        }
    }
    let count = |is: fn(&Outcome) -> bool| all.iter().filter(|one| is(one)).count();
    let asked = all.len();
    let (near, class) = (count(|one| one.is_near), count(|one| one.is_class));
    println!("predicted within 15 % or .05 of the truth: {near} of {asked}");
    println!("severity by its cost right: {class} of {asked}");
    let falsely = count(|one| one.is_good && one.repaired.unwrap_or(one.truth) > 1.15);
    println!(
        "good in truth above 1.15: {falsely} of {}",
        count(|one| one.is_good)
    );
    let well = count(|one| one.repaired.is_some_and(|ratio| ratio < 1.05));
    let repaired = count(|one| one.repaired.is_some());
    println!("repaired within 1.05 of the clean: {well} of {repaired}");
}
