//! Faults of channels in simulated logs: what is predicted for service, what is true there, and what the
//! repaired calibration makes of it.

use crate::common::{Twin, rms};
use crate::service;
use host_fit::calibration::diagnose::diagnose_log;
use host_fit::calibration::fit::{FitSettings, ModelChoice, fit};
use host_fit::calibration::judge::verdict::Verdict;
use host_fit::input::dataset::Dataset;
use host_fit::input::finding::Severity;
use host_fit::input::stage::Stage;
use host_fit::simulate::protocol::{Protocol, Run, Trajectory};
use host_fit::simulate::recording::Sample;
use host_fit::solver::solve::field::parameters::FieldParameters;
use runtime::ParameterSet;

/// What becomes of a sample of which this part of the log is over, and of its number.
type Fault = (&'static str, Stays, fn(&mut Sample, f64, usize, &Stage));

/// Whether the stage is another one after the log.
#[derive(Clone, Copy, PartialEq)]
enum Stays {
    Yes,
    No,
}

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
    ("Hall B gain .2 %", Stays::Yes, |s, t, _, _| if t > 0.47 { gain(&mut s.hall[1], 0.2) }),
    ("Hall B gain .5 %", Stays::Yes, |s, t, _, _| if t > 0.47 { gain(&mut s.hall[1], 0.5) }),
    ("Hall A gain 1 %", Stays::Yes, |s, t, _, _| if t > 0.6 { gain(&mut s.hall[0], 1.0) }),
    ("Hall C gain -2 %", Stays::Yes, |s, t, _, _| if t > 0.35 { gain(&mut s.hall[2], -2.0) }),
    ("all Halls -1 %", Stays::Yes, |s, t, _, _| if t > 0.5 { s.hall.iter_mut().for_each(|c| gain(c, -1.0)) }),
    ("gain ramp C .5 %", Stays::Yes, |s, t, _, _| gain(&mut s.hall[2], 0.5 * t)),
    ("gain ramp C 3 %", Stays::Yes, |s, t, _, _| gain(&mut s.hall[2], 3.0 * t)),
    ("gain A up and back 2 %", Stays::No, |s, t, _, _| if (0.3..0.6).contains(&t) { gain(&mut s.hall[0], 2.0) }),
    ("beam Y1 step 2 um", Stays::No, |s, t, _, _| if t > 0.53 { s.beams_nm[1] += 2_000 }),
    ("beam Y1 step 5 um", Stays::No, |s, t, _, _| if t > 0.53 { s.beams_nm[1] += 5_000 }),
    ("beam X step 10 um", Stays::No, |s, t, _, _| if t > 0.33 { s.beams_nm[0] += 10_000 }),
    ("beam Y2 step 25 um", Stays::No, |s, t, _, _| if t > 0.71 { s.beams_nm[2] += 25_000 }),
    ("Hall A step 5 um", Stays::No, |s, t, _, g| if t > 0.4 { hall(s, g, 0, 5.0) }),
    ("Hall C step 25 um", Stays::No, |s, t, _, g| if t > 0.61 { hall(s, g, 2, 25.0) }),
    ("capacitive 2 step 10 um", Stays::Yes, |s, t, _, g| if t > 0.5 { gap(s, g, 1, 10.0) }),
    ("capacitive 3 step 2 um", Stays::Yes, |s, t, _, g| if t > 0.4 { gap(s, g, 2, 2.0) }),
    ("capacitive 1 gain 2 %", Stays::Yes, |s, t, _, _| if t > 0.5 { gain(&mut s.capacitive[0], 2.0) }),
    ("capacitive 3 gain .5 %", Stays::Yes, |s, t, _, _| if t > 0.5 { gain(&mut s.capacitive[2], 0.5) }),
    ("drift A .1 um/s", Stays::No, |s, t, _, g| hall(s, g, 0, 2.0 * t)),
    ("drift B 1 um/s", Stays::No, |s, t, _, g| hall(s, g, 1, 20.0 * t)),
    ("hum 50 Hz 3 um B", Stays::No, |s, _, n, g| hall(s, g, 1, 3.0 * (n as f64 * 0.628_318_53).sin())),
    ("hum 7 Hz 2 um A", Stays::No, |s, _, n, g| hall(s, g, 0, 2.0 * (n as f64 * 0.087_964_59).sin())),
    ("outliers 1 % A 50 um", Stays::No, |s, _, n, g| if n % 100 == 37 { hall(s, g, 0, 50.0) }),
    ("outliers .1 % X 200 um", Stays::No, |s, _, n, _| if n % 1000 == 37 { s.beams_nm[0] += 200_000 }),
    ("beams 1 % longer", Stays::No, |s, t, _, _| if t > 0.5 { s.beams_nm = s.beams_nm.map(|nm| nm + nm / 100) }),
    ("gain .1 % and gap 3 um", Stays::Yes, |s, t, _, g| if t > 0.5 { gain(&mut s.hall[2], 0.1); gap(s, g, 0, 3.0) }),
    ("Hall noise x 2", Stays::No, |s, _, n, g| hall(s, g, 2, 0.87 * (((n * 7919) % 1000) as f64 / 500.0 - 1.0))),
];

/// Worst errors of a blob in service over the noise floor, which clean fits have.
fn ratio(set: &ParameterSet, service: &Dataset, stage: &Stage, floor: [f64; 3]) -> f64 {
    let errors = rms(set, service, stage);
    (0..3).map(|k| errors[k] / floor[k]).fold(0.0, f64::max)
}

/// Hits of each question of the table.
#[derive(Default)]
struct Score {
    asked: usize,
    near: usize,
    class: usize,
    repaired: usize,
    repaired_well: usize,
    good: usize,
    falsely_good: usize,
}

/// Prints the table of faults, then the score.
pub fn table(stage: &Stage, planned: &Trajectory, seeds: std::ops::Range<u64>) {
    println!(
        "{:<26}{:>9}{:>9}{:>9}{:>9}  class, verdict",
        "fault", "predicted", "true", "repaired", "true"
    );
    let mut score = Score::default();
    for seed in seeds {
        let run = match seed % 2 {
            0 => Protocol::Combined.run(stage.servo_period_s, seed),
            _ => Run::planned(planned.clone()),
        };
        let twin = Twin::new(stage, seed);
        let (clean, service) = (twin.record(run), service(&twin));
        let of_clean = clean.dataset(stage).expect("a plane");
        let settings = FitSettings {
            force: true,
            ..FitSettings::new(ModelChoice::Auto)
        };
        let fitted = fit(&of_clean, stage, &settings).expect("a fit");
        let of_service = service.dataset(stage).expect("a plane");
        let floor = rms(&fitted.set, &of_service, stage);
        for (name, stays, fault) in FAULTS {
            let rows = clean.rows() as f64;
            let mut faulty = clean.clone();
            for (n, sample) in faulty.movements.iter_mut().flatten().enumerate() {
                fault(sample, n as f64 / rows, n, stage);
            }
            let mut at_work = service.clone();
            if stays == Stays::Yes {
                for sample in at_work.movements.iter_mut().flatten() {
                    fault(sample, 1.0, 0, stage);
                }
            }
            let at_work = at_work.dataset(stage).expect("a plane");
            let dataset = faulty.dataset(stage).expect("a plane");
            let fitted = fit(&dataset, stage, &settings);
            let diagnosis = diagnose_log(&dataset, stage, fitted.as_ref());
            let Ok(fitted) = fitted else {
                println!("{name:<26} no fit");
                continue;
            };
            let truth = ratio(&fitted.set, &at_work, stage, floor);
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
                ratio(&set, &at_work, stage, floor)
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
            let last = repaired.unwrap_or(truth);
            let is_good = diagnosis.verdict == Some(Verdict::Good);
            score.asked += 1;
            score.near += usize::from(is_near);
            score.class += usize::from(is_class);
            score.repaired += usize::from(repaired.is_some());
            score.repaired_well += usize::from(repaired.is_some_and(|ratio| ratio < 1.05));
            score.good += usize::from(is_good);
            score.falsely_good += usize::from(is_good && last > 1.15);
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
    let Score { asked, .. } = score;
    println!(
        "predicted within 15 % or .05 of the truth: {} of {asked}",
        score.near
    );
    println!("severity by its cost right: {} of {asked}", score.class);
    println!(
        "good in truth above 1.15: {} of {}",
        score.falsely_good, score.good
    );
    println!(
        "repaired within 1.05 of the clean: {} of {}",
        score.repaired_well, score.repaired
    );
}
