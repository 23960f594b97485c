//! Every mistake is named, with all mistakes that a log cannot separate from it.

use super::structure::structure;
use crate::words::message;
use hallstage_input::finding::{Code, Severity};
use hallstage_input::shipped::STAGE_TOML;
use hallstage_input::stage::Stage;
use hallstage_simulate::assembly::Assembly;
use hallstage_simulate::protocol::Protocol;
use hallstage_simulate::recording::{Recording, Sample, record};
use hallstage_simulate::sensors::SensorErrors;

fn stage(from: &str, to: &str) -> Stage {
    assert!(STAGE_TOML.contains(from));
    let toml = STAGE_TOML.replacen(from, to, 1);
    Stage::from_toml(&toml, "stage.toml".as_ref()).expect("sound")
}

fn recordings() -> [Recording; 2] {
    let stage = stage("", "");
    [(Protocol::Paper, 3), (Protocol::Combined, 4)].map(|(protocol, seed)| {
        let assembly = Assembly::draw(&stage, seed);
        let run = protocol.run(stage.servo_period_s, seed);
        record(&stage, &assembly, run, &SensorErrors::USUAL, seed).expect("clear")
    })
}

#[test]
fn a_sound_log_is_that_of_its_stage() {
    let stage = stage("", "");
    for recording in recordings() {
        let dataset = recording.dataset(&stage).expect("a triangle");
        assert_eq!(structure(&dataset, &stage, false), None);
    }
}

/// Two seconds show little, and the residuals of the simple form follow the motion.
#[test]
fn a_short_sound_log_has_no_mistake() {
    let stage = stage("", "");
    for seed in [22, 47, 67] {
        let run = Protocol::Combined.run(stage.servo_period_s, seed);
        let assembly = Assembly::draw(&stage, seed);
        let recording = record(&stage, &assembly, run, &SensorErrors::USUAL, seed);
        let mut recording = recording.expect("clear");
        recording.movements.truncate(1);
        recording.movements[0].truncate(1000);
        let dataset = recording.dataset(&stage).expect("a triangle");
        assert_eq!(structure(&dataset, &stage, false), None, "{seed}");
    }
}

#[test]
fn a_mistake_with_channels_is_named_with_all_that_a_log_cannot_tell_it_from() {
    type Mistake = (Code, &'static [&'static str], fn(&mut Sample));
    let both: &[&str] = &[
        "the scale of all Hall probes is multiplied by about 2.0",
        "the scale of all beams is multiplied by about 0.50",
    ];
    let mistakes: [Mistake; 11] = [
        (
            Code::ChannelsSwapped,
            &["Hall A and Hall C are exchanged"],
            |s| s.hall.swap(0, 2),
        ),
        (
            Code::ChannelInverted,
            &["the sign of Hall B is inverted"],
            |s| s.hall[1] = -s.hall[1],
        ),
        (
            Code::BeamsSwapped,
            &["beam Y1 and beam Y2 are exchanged"],
            |s| s.beams_nm.swap(1, 2),
        ),
        (
            Code::BeamInverted,
            &["the sign of beam X is inverted"],
            |s| s.beams_nm[0] = -s.beams_nm[0],
        ),
        (
            Code::CapacitiveSwapped,
            &[
                "capacitive sensor 1 and capacitive sensor 2 are exchanged",
                "the places of the capacitive sensors are mirrored along x",
            ],
            |s| s.capacitive.swap(0, 1),
        ),
        (
            Code::ScaleWrong,
            &["the scale of all capacitive sensors is multiplied by about 10"],
            |s| {
                s.capacitive = s.capacitive.map(|code| code / 10);
            },
        ),
        (
            Code::ScaleWrong,
            &["the scale of Hall B is multiplied by about 0.50"],
            |s| s.hall[1] *= 2,
        ),
        (
            Code::ScaleWrong,
            &["the scale of Hall A is multiplied by about 0.6"],
            |s| {
                s.hall[0] += s.hall[0] / 2;
            },
        ),
        (
            Code::ScaleWrong,
            &["the scale of all beams is multiplied by about 1000"],
            |s| {
                s.beams_nm = s.beams_nm.map(|nm| nm / 1000);
            },
        ),
        (
            Code::ScaleWrong,
            &["the scale of beam Y1 and beam Y2 is multiplied by about 0.50"],
            |s| (1..3).for_each(|beam| s.beams_nm[beam] *= 2),
        ),
        (Code::ScaleWrong, both, |s| {
            s.beams_nm = s.beams_nm.map(|nm| 2 * nm)
        }),
    ];
    let stage = stage("", "");
    for recording in recordings() {
        for (code, cures, mistake) in mistakes {
            let mut recording = recording.clone();
            recording.movements.iter_mut().flatten().for_each(mistake);
            let dataset = recording.dataset(&stage).expect("a triangle");
            let found = structure(&dataset, &stage, false).expect("a finding");
            assert_eq!(
                (found.code(), found.severity),
                (code, Severity::Refuse),
                "{found:?}"
            );
            for cure in cures {
                assert!(
                    message(&found).contains(cure),
                    "{cure}: {}",
                    message(&found)
                );
            }
            assert_eq!(
                message(&found).matches(", or if ").count(),
                cures.len() - 1,
                "{}",
                message(&found)
            );
        }
    }
}

#[test]
fn a_mistake_in_the_stage_file_is_named() {
    const PLACES: &str = "[[0.12, 0.0], [-0.12, 0.0], [0.0, -0.12]]";
    for (from, to, cure) in [
        (
            "y_baseline_m = 0.10",
            "y_baseline_m = 0.20",
            "Rz of the reference (1 / interferometer.y_baseline_m) is multiplied by about 2.0",
        ),
        (
            "[0.0, -0.12]]",
            "[0.0, 0.12]]",
            "the y of capacitive sensor 3 in stage.toml is -0.12 m",
        ),
        (
            PLACES,
            "[[0.06, 0.0], [-0.06, 0.0], [0.0, -0.06]]",
            "sensors are multiplied by about 2.0",
        ),
        (
            PLACES,
            "[[0.0, 0.12], [0.0, -0.12], [0.12, 0.0]]",
            "sensors are turned by about -90 degrees",
        ),
        (
            PLACES,
            "[[0.092, 0.077], [-0.092, -0.077], [0.077, -0.092]]",
            "sensors are turned by about -40 degrees",
        ),
    ] {
        let stage = stage(from, to);
        for recording in recordings() {
            let dataset = recording.dataset(&stage).expect("a triangle");
            let found = structure(&dataset, &stage, false).expect("a finding");
            assert!(
                message(&found).contains(cure),
                "{cure}: {}",
                message(&found)
            );
        }
    }
}

/// Gaps by a third may be other magnets, which are no mistake.
#[test]
fn scales_near_one_are_named_with_what_may_be_the_cause_as_well() {
    type Scale = (Severity, [&'static str; 2], fn(&mut Sample));
    let beams = [
        "the scale of beam Y1 is multiplied by about 0.91",
        "beam Y2",
    ];
    let gaps = [
        "the scale of all capacitive sensors is",
        "the field of the magnets",
    ];
    let scales: [Scale; 2] = [
        (Severity::Refuse, beams, |s| {
            s.beams_nm[1] += s.beams_nm[1] / 10
        }),
        (Severity::Warn, gaps, |s| {
            s.capacitive = s.capacitive.map(|code| code * 2 / 3)
        }),
    ];
    let stage = stage("", "");
    for (mut recording, (severity, causes, scale)) in recordings()
        .into_iter()
        .flat_map(|recording| scales.map(|scale| (recording.clone(), scale)))
    {
        recording.movements.iter_mut().flatten().for_each(scale);
        let dataset = recording.dataset(&stage).expect("a triangle");
        let found = structure(&dataset, &stage, false).expect("a finding");
        assert_eq!((found.code(), found.severity), (Code::ScaleWrong, severity));
        for cause in causes {
            assert!(message(&found).contains(cause), "{}", message(&found));
        }
    }
}

/// Probes at twice the distance show half of the turns and tilts.
#[test]
fn places_of_the_hall_probes_at_twice_the_distance_are_named() {
    let stage = stage("", "");
    for recording in recordings() {
        let mut dataset = recording.dataset(&stage).expect("a triangle");
        for row in &mut dataset.rows {
            let [_, _, rz] = &mut row.reference;
            let [_, rx, ry] = &mut row.vertical;
            [rz, rx, ry].into_iter().for_each(|turn| *turn *= 2.0);
        }
        let found = structure(&dataset, &stage, false).expect("a finding");
        let cure = "the places of the Hall probes are multiplied by about 2.0";
        assert!(message(&found).contains(cure), "{}", message(&found));
    }
}

/// A third of the radius changes less than chance may, but not in a log that fits to nothing.
#[test]
fn a_mistake_is_more_likely_where_nothing_else_describes_the_log() {
    let stage = stage(
        "[[0.12, 0.0], [-0.12, 0.0], [0.0, -0.12]]",
        "[[0.084, 0.0], [-0.084, 0.0], [0.0, -0.084]]",
    );
    let [_, recording] = recordings();
    let dataset = recording.dataset(&stage).expect("a triangle");
    assert_eq!(structure(&dataset, &stage, false), None);
    let found = structure(&dataset, &stage, true).expect("a finding");
    assert_eq!(
        (found.code(), found.severity),
        (Code::ScaleWrong, Severity::Warn)
    );
    assert!(
        message(&found).contains("sensors are multiplied by"),
        "{}",
        message(&found)
    );
}
