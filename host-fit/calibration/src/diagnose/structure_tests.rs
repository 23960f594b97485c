//! Every mistake is named, with all mistakes that a log cannot separate from it.

use super::structure::structure;
use crate::fit::{FitSettings, ModelChoice, fit};
use hallstage_input::channel::Channel::{
    self, BeamX, BeamY1, BeamY2, Gap1, Gap2, Gap3, HallA, HallB, HallC,
};
use hallstage_input::dataset::Dataset;
use hallstage_input::finding::Correction::{
    BaselineScale, Exchange, GapPlace, GapPlaces, GapsMirrored, GapsTurned, HallPlaces, Scale, Sign,
};
use hallstage_input::finding::{Code, Correction, Finding, Kind, Severity};
use hallstage_input::shipped::STAGE_TOML;
use hallstage_input::stage::Stage;
use hallstage_simulate::assembly::Assembly;
use hallstage_simulate::protocol::Protocol;
use hallstage_simulate::recording::{Recording, Sample, record};
use hallstage_simulate::sensors::SensorErrors;
use hallstage_solver::estimator::model::Model;
use runtime::ModelKind;

/// The shipped stage with a change of its file.
fn stage(from: &str, to: &str) -> Stage {
    assert!(STAGE_TOML.contains(from));
    let toml = STAGE_TOML.replacen(from, to, 1);
    Stage::from_toml(&toml, "stage.toml".as_ref()).expect("sound")
}

fn recording(protocol: Protocol, seed: u64) -> Recording {
    let stage = stage("", "");
    let assembly = Assembly::draw(&stage, seed);
    let run = protocol.run(stage.servo_period_s, seed);
    record(&stage, &assembly, run, &SensorErrors::USUAL, seed).expect("clear")
}

/// A log of the paper's protocol and a log of all axes, with a change of every sample.
fn datasets(stage: &Stage, change: impl Fn(&mut Sample)) -> [Dataset; 2] {
    [(Protocol::Paper, 3), (Protocol::Combined, 4)].map(|(protocol, seed)| {
        let mut recording = recording(protocol, seed);
        recording.movements.iter_mut().flatten().for_each(&change);
        recording.dataset(stage).expect("a triangle")
    })
}

/// The corrections of a finding with their values, the best first.
fn causes(found: &Finding) -> Vec<(Correction, Option<f64>)> {
    let Kind::Mistake { causes, .. } = &found.kind else {
        panic!("{found:?}");
    };
    let best = |values: [f64; 3]| values[0];
    let causes = causes.iter();
    causes
        .map(|cause| (cause.correction.clone(), cause.values.map(best)))
        .collect()
}

/// Whether these are among the causes, each with its value within an eighth.
fn are_named(found: &Finding, wanted: &[(Correction, Option<f64>)]) -> bool {
    let causes = causes(found);
    let is_near = |a: Option<f64>, b: Option<f64>| match (a, b) {
        (Some(a), Some(b)) => (a - b).abs() <= 0.125 * b.abs(),
        (a, b) => a == b,
    };
    let has = |(correction, value): &(Correction, Option<f64>)| {
        causes
            .iter()
            .any(|(named, best)| named == correction && is_near(*best, *value))
    };
    wanted.iter().all(has)
}

#[test]
fn a_sound_log_is_that_of_its_stage_also_a_short_one() {
    let stage = stage("", "");
    for dataset in datasets(&stage, |_| ()) {
        assert_eq!(structure(&dataset, &stage, false, None), None);
    }
    // Two seconds show little, and the residuals of the simple form follow the motion.
    let whole = recording(Protocol::Combined, 4);
    for (number, piece) in (whole.movements.iter().flat_map(|of| of.chunks(1000))).enumerate() {
        let short = Recording {
            movements: vec![piece.to_vec()],
            ..whole.clone()
        };
        let dataset = short.dataset(&stage).expect("a triangle");
        assert_eq!(structure(&dataset, &stage, false, None), None, "{number}");
    }
}

#[test]
fn a_mistake_with_channels_is_named_with_all_that_a_log_cannot_tell_it_from() {
    type Mistake = (Code, Vec<(Correction, Option<f64>)>, fn(&mut Sample));
    let scale = |some: &[Channel], by: f64| (Scale(some.to_vec()), Some(by));
    let sign = |channel: Channel| (Sign(vec![channel]), None);
    let exchange = |one, other| (Exchange([one, other]), None);
    let mirrored = (GapsMirrored, Some(0.0));
    let both = vec![scale(&[Channel::Halls], 2.0), scale(&[Channel::Beams], 0.5)];
    let mistakes: [Mistake; 11] = [
        (Code::ChannelsSwapped, vec![exchange(HallA, HallC)], |s| {
            s.hall.swap(0, 2)
        }),
        (Code::ChannelInverted, vec![sign(HallB)], |s| {
            s.hall[1] *= -1
        }),
        (Code::BeamsSwapped, vec![exchange(BeamY1, BeamY2)], |s| {
            s.beams_nm.swap(1, 2)
        }),
        (Code::BeamInverted, vec![sign(BeamX)], |s| {
            s.beams_nm[0] *= -1
        }),
        (
            Code::CapacitiveSwapped,
            vec![exchange(Gap1, Gap2), mirrored],
            |s| s.capacitive.swap(0, 1),
        ),
        (Code::ScaleWrong, vec![scale(&[Channel::Gaps], 10.0)], |s| {
            s.capacitive = s.capacitive.map(|code| code / 10);
        }),
        (Code::ScaleWrong, vec![scale(&[HallB], 0.5)], |s| {
            s.hall[1] *= 2
        }),
        (Code::ScaleWrong, vec![scale(&[HallA], 0.67)], |s| {
            s.hall[0] += s.hall[0] / 2
        }),
        (
            Code::ScaleWrong,
            vec![scale(&[Channel::Beams], 1000.0)],
            |s| {
                s.beams_nm = s.beams_nm.map(|nm| nm / 1000);
            },
        ),
        (Code::ScaleWrong, vec![scale(&[BeamY1, BeamY2], 0.5)], |s| {
            (1..3).for_each(|beam| s.beams_nm[beam] *= 2);
        }),
        (Code::ScaleWrong, both, |s| {
            s.beams_nm = s.beams_nm.map(|nm| 2 * nm)
        }),
    ];
    let stage = stage("", "");
    for (code, wanted, mistake) in mistakes {
        for dataset in datasets(&stage, mistake) {
            let found = structure(&dataset, &stage, false, None).expect("a finding");
            assert_eq!((found.code(), found.severity), (code, Severity::Refuse));
            assert!(are_named(&found, &wanted), "{wanted:?}: {found:?}");
            assert_eq!(causes(&found).len(), wanted.len(), "{found:?}");
        }
    }
}

#[test]
fn a_mistake_in_the_stage_file_is_named() {
    const PLACES: &str = "[[0.12, 0.0], [-0.12, 0.0], [0.0, -0.12]]";
    let halved = "[[0.06, 0.0], [-0.06, 0.0], [0.0, -0.06]]";
    let turned = "[[0.0, 0.12], [0.0, -0.12], [0.12, 0.0]]";
    let askew = "[[0.092, 0.077], [-0.092, -0.077], [0.077, -0.092]]";
    for (from, to, correction, value) in [
        (
            "y_baseline_m = 0.10",
            "y_baseline_m = 0.20",
            BaselineScale,
            Some(2.0),
        ),
        (
            "[0.0, -0.12]]",
            "[0.0, 0.12]]",
            GapPlace(Gap3, "y", -0.12),
            None,
        ),
        (PLACES, halved, GapPlaces, Some(2.0)),
        (PLACES, turned, GapsTurned, Some(-90.0)),
        (PLACES, askew, GapsTurned, Some(-40.0)),
    ] {
        let stage = stage(from, to);
        for dataset in datasets(&stage, |_| ()) {
            let found = structure(&dataset, &stage, false, None).expect("a finding");
            assert!(
                are_named(&found, &[(correction.clone(), value)]),
                "{found:?}"
            );
        }
    }
}

/// Gaps by a third may be other magnets, which are no mistake.
#[test]
fn scales_near_one_are_named_with_what_may_be_the_cause_as_well() {
    type Case = (Severity, Vec<Correction>, fn(&mut Sample));
    let beams = [BeamY1, BeamY2].map(|beam| Scale(vec![beam])).to_vec();
    let cases: [Case; 3] = [
        (Severity::Refuse, beams, |s| {
            s.beams_nm[1] += s.beams_nm[1] / 10
        }),
        // Heights and tilts are wrong, X, Y, Rz are right.
        (Severity::Warn, vec![Scale(vec![Gap1])], |s| {
            s.capacitive[0] += s.capacitive[0] / 5;
        }),
        (Severity::Warn, vec![Scale(vec![Channel::Gaps])], |s| {
            s.capacitive = s.capacitive.map(|code| code * 2 / 3);
        }),
    ];
    let stage = stage("", "");
    for (severity, wanted, scale) in cases {
        for dataset in datasets(&stage, scale) {
            let found = structure(&dataset, &stage, false, None).expect("a finding");
            assert_eq!((found.code(), found.severity), (Code::ScaleWrong, severity));
            let causes = causes(&found);
            let has = |wanted: &Correction| causes.iter().any(|(named, _)| named == wanted);
            assert!(wanted.iter().all(has), "{found:?}");
            let is_magnets = matches!(
                found.kind,
                Kind::Mistake {
                    may_be_magnets: true,
                    ..
                }
            );
            assert_eq!(is_magnets, wanted == [Scale(vec![Channel::Gaps])]);
        }
    }
}

/// Probes at twice the distance show half of the turns and tilts.
#[test]
fn places_of_the_hall_probes_at_twice_the_distance_are_named() {
    let stage = stage("", "");
    for mut dataset in datasets(&stage, |_| ()) {
        for row in &mut dataset.rows {
            let [_, _, rz] = &mut row.reference;
            let [_, rx, ry] = &mut row.vertical;
            [rz, rx, ry].into_iter().for_each(|turn| *turn *= 2.0);
        }
        let found = structure(&dataset, &stage, false, None).expect("a finding");
        assert!(are_named(&found, &[(HallPlaces, Some(2.0))]), "{found:?}");
    }
}

/// A third of the radius changes less than chance may, but not in a log that fits to nothing.
#[test]
fn a_mistake_is_more_likely_where_nothing_else_describes_the_log() {
    let stage = stage(
        "[[0.12, 0.0], [-0.12, 0.0], [0.0, -0.12]]",
        "[[0.084, 0.0], [-0.084, 0.0], [0.0, -0.084]]",
    );
    let [_, dataset] = datasets(&stage, |_| ());
    assert_eq!(structure(&dataset, &stage, false, None), None);
    let found = structure(&dataset, &stage, true, None).expect("a finding");
    assert_eq!(
        (found.code(), found.severity),
        (Code::ScaleWrong, Severity::Warn)
    );
    let is_named = causes(&found).iter().any(|(named, _)| *named == GapPlaces);
    assert!(is_named, "{found:?}");
}

/// A signal without its sign, a converter that wraps: no change of scales, signs and places leads there.
#[test]
fn what_is_not_linear_is_no_mistake_with_channels() {
    let stage = stage("", "");
    let folded = datasets(&stage, |s| s.hall[1] = s.hall[1].abs());
    let wrapped = datasets(&stage, |s| {
        s.hall[1] = i32::from((s.hall[1] + 32_768) as i16)
    });
    for dataset in folded.into_iter().chain(wrapped) {
        let found = structure(&dataset, &stage, true, None).expect("a finding");
        assert_eq!(
            (found.kind, found.channels),
            (Kind::NotLinear {}, vec![HallB])
        );
    }
}

#[test]
fn two_mistakes_at_once_are_refused_without_a_name() {
    let stage = stage("", "");
    let two = datasets(&stage, |s| {
        s.hall[0] *= -1;
        s.beams_nm[0] *= -1;
    });
    for dataset in two {
        let found = structure(&dataset, &stage, false, None).expect("a finding");
        assert!(matches!(found.kind, Kind::OtherProbes { .. }), "{found:?}");
        assert_eq!(found.severity, Severity::Refuse);
    }
}

/// Without a range of eta in the stage file strong magnets do the same.
#[test]
fn a_reference_in_single_pass_for_double_pass_is_named_by_the_sensitivities() {
    let lines = STAGE_TOML.lines().filter(|line| !line.starts_with("eta_"));
    let toml: Vec<&str> = lines.collect();
    let open = Stage::from_toml(&toml.join("\n"), "stage.toml".as_ref()).expect("sound");
    for dataset in datasets(&open, |s| s.beams_nm = s.beams_nm.map(|nm| nm / 2)) {
        let found = structure(&dataset, &open, false, None).expect("a finding");
        assert_eq!(found.severity, Severity::Warn);
        assert_eq!(causes(&found), [(Scale(vec![Channel::Beams]), Some(2.0))]);
    }
    for dataset in datasets(&open, |_| ()) {
        assert_eq!(structure(&dataset, &open, false, None), None);
    }
}

/// The slopes of the sensitivities show where the probes stand, the lever arms show it in units of the baseline.
#[test]
fn a_baseline_that_the_places_of_the_probes_contradict_is_named() {
    for (baseline, factor) in [("0.08", Some(0.8)), ("0.12", Some(1.2)), ("0.101", None)] {
        let stage = stage("y_baseline_m = 0.10", &format!("y_baseline_m = {baseline}"));
        let dataset = recording(Protocol::Combined, 4)
            .dataset(&stage)
            .expect("a triangle");
        let model = ModelChoice::Named(Model::from_kind(ModelKind::Field));
        let fit = fit(&dataset, &stage, &FitSettings::new(model)).expect("a fit");
        let known = (&fit.estimate.parameters, &fit.estimate.posterior.covariance);
        let found = structure(&dataset, &stage, false, Some(known));
        match factor {
            Some(_) => {
                let found = found.expect("a finding");
                assert!(are_named(&found, &[(BaselineScale, factor)]), "{found:?}");
            }
            None => assert_eq!(found, None),
        }
    }
}
