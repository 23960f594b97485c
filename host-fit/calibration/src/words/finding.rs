//! The message of a finding: the evidence with its size, the place, and the remedy.

use super::causes::mistake_remedy;
use super::evidence::{SENSORS, evidence};
use super::sentence;
use hallstage_input::finding::{Code, Finding, Kind, Place, Severity};

/// The message.
pub fn message(found: &Finding) -> String {
    let mut text = source(found) + &sentence(&evidence(found));
    if let Some(Place { movement, t_us }) = &found.place {
        text += &format!(" See movement {movement} at t_us = {t_us}.");
    }
    if let Some([rows, all]) = found.sample {
        text += &format!(" This is from {rows} of {all} rows.");
    }
    if found.is_repaired && is_late_sensor(found) {
        text += " The parameters are free of this lag. In service the channel stays late.";
    } else if found.is_repaired {
        text += " The calibration is free of this fault and describes the stage at the end of the log: zero the stage before use.";
    }
    match remedy(found) {
        remedy if remedy.is_empty() => text,
        remedy => text + " " + &sentence(&remedy),
    }
}

/// Whether it is about a sensor that stays late in service.
pub(super) fn is_late_sensor(found: &Finding) -> bool {
    let is_beam = found.channels().iter().all(|channel| channel.is_beam());
    found.code() == Code::ReferenceLag && !is_beam
}

/// The file or the log of the finding.
fn source(found: &Finding) -> String {
    match (&found.kind, &found.log) {
        (Kind::FileCut { file, line }, _) => format!("{file}:{line}: "),
        (
            Kind::SingleRows { file, .. }
            | Kind::ColumnsLeftOut { file, .. }
            | Kind::MovementsByTime { file, .. }
            | Kind::BetweenCodes { file, .. }
            | Kind::RowsSkipped { file, .. }
            | Kind::MovementsSkipped { file, .. },
            _,
        ) => format!("{file}: "),
        (_, Some(log)) => format!("{log}: "),
        (_, None) => String::new(),
    }
}

/// What to do: the usual remedy of the code, unless the kind needs another; empty if there is nothing to do.
#[rustfmt::skip]
pub fn remedy(found: &Finding) -> String {
    let remedy = match &found.kind {
        Kind::Excerpt { .. } | Kind::CodesRefused { .. } | Kind::OtherModel { .. } => "",
        Kind::Coefficients { deviations: None, span_k, is_field, .. } if *span_k > 0.0 || !is_field => "",
        Kind::Coefficients { deviations: Some(_), sensor, .. } => {
            return format!("check the sensor, its column, unit and sign, and `{}`", SENSORS[*sensor].2);
        }
        Kind::TemperatureChange { rezero_k, .. } => {
            return format!("zero the stage again after every {rezero_k} K, because offsets and expansion are not in the model");
        }
        Kind::Mistake { code, causes, may_be_magnets, .. } => return mistake_remedy(*code, causes, *may_be_magnets),
        Kind::InMotion { shows_acceleration: false, .. } => "record the run of host-fit plan, whose second tone shows it, or evaluate on your fastest motion",
        Kind::FasterLog { .. } if found.severity == Severity::Note => "",
        Kind::FasterLog { .. } => "the verdict is at best limited; for service that moves so, declare its motion in [motion], and apply the correction (runtime/README.md)",
        Kind::Resets { .. } => "log resets as movements",
        Kind::SingleRows { .. } => "check the movement column",
        Kind::GroupNoise { percent } if *percent > 0.0 => "check what the channels share: supply, ground, converter, and magnetic fields nearby",
        Kind::RowsMissing { .. } => "look for frames that the recorder lost",
        Kind::OtherRate { .. } => "log every period, or correct servo.period_s",
        Kind::Stands { percent: 100.0, .. } => "is it connected?",
        Kind::NotLinear {} => "look at its codes, and fit the logs one by one",
        Kind::Inconsistent { .. } => "check that channel and the reference, and record the log again",
        Kind::FaultsTogether { .. } => "see the other findings, and record the log again",
        Kind::OtherProbes { .. } => "check order and signs of all channels, the scales and the designed values in stage.toml",
        Kind::ShortMovements { .. } => "check the times and the movement column; a log without this column begins a movement after every gap of more than ten rows",
        Kind::LateReference { is_declared: true, .. } => "set the delay of the probes to that of the reference, or declare a slower service in [motion]",
        Kind::LateReference { .. } => "declare the latency of the reference, latency_us in [interferometer] of stage.toml: the rest of the lag then counts as one of the probes. Or judge the poses in motion by another reference",
        Kind::AtLimit { .. } => "check the scales and signs of that probe and of the beams; if they are right, widen the range in stage.toml",
        Kind::MovementsMissed { .. } => "use --draw stratified, or a larger --train",
        Kind::OtherUnit { .. } => "check the unit of the column in the log and in stage.toml",
        Kind::TemperaturesExchanged { .. } => "check `mount` and `body` in [temperature], and the sensors",
        Kind::OtherMotion { is_scale: true, .. } => "correct the scale or [motion]",
        Kind::OtherMotion { .. } => "errors beyond the range of the log are larger than predicted; host-fit plan makes a run of the full range",
        Kind::BeyondRange { .. } => "fit logs of the whole range of service",
        Kind::NoTemperature { .. } => "check the columns of [temperature], their units and the sensors",
        _ => found.code().entry().remedy,
    };
    remedy.to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use hallstage_input::channel::Channel;
    use hallstage_input::finding::{Cause, Correction, Quantity, TimeCourse};

    #[test]
    fn a_message_has_evidence_with_units_place_alternatives_and_remedy() {
        let hum = Finding {
            log: Some("b.csv".to_owned()),
            sample: Some([10, 20]),
            ..Finding::new(Kind::Hum {
                frequency_hz: 50.0,
                amplitude_um: 2.0,
            })
        };
        assert_eq!(
            message(&hum.with_channel(Channel::HallA)),
            "b.csv: Hall A hums at 50.0 Hz with an amplitude of 2.00 µm. This is from 10 of 20 rows. Look for mains (50 or 60 Hz and multiples) in the cable and the supply, or for a vibration."
        );
        let (quantity, course) = (Quantity::Gain, TimeCourse::Onset);
        let gain = Finding::new(Kind::Change {
            quantity,
            course,
            size: -1.0,
        });
        let gain = Finding {
            alike: vec![Channel::Beams],
            is_repaired: true,
            ..gain
                .with_channel(Channel::Halls)
                .with_place("3", 7)
                .with_cost(5.0)
        };
        assert_eq!(
            message(&gain),
            "The gain of all Hall probes or all beams changes by -1.00 %. The log does not show which. Alone it makes errors in service of 5.00 times the noise floor. See movement 3 at t_us = 7. The calibration is free of this fault and describes the stage at the end of the log: zero the stage before use. Let the channel warm up, and check its supply."
        );
        let stands = Kind::Stands {
            rows: 5,
            percent: 100.0,
            longest_s: 1.0,
            is_end: true,
        };
        let stands = Finding::new(stands).with_channel(Channel::Gap2);
        assert_eq!(
            message(&stands),
            "Capacitive sensor 2 never changes. Is it connected?"
        );
        let swapped = Kind::Mistake {
            code: Code::BeamsSwapped,
            causes: vec![Cause {
                correction: Correction::Exchange([Channel::BeamY1, Channel::BeamY2]),
                values: None,
            }],
            is_sure: true,
            may_be_magnets: false,
        };
        assert_eq!(
            message(&Finding::new(swapped)),
            "Beam Y1 and beam Y2 seem to be swapped; exchanged, the log fits stage.toml. Check the column order."
        );
        let moves = Kind::OtherMotion {
            micro: 1002.0,
            service_micro: 500.0,
            unit: "um",
            is_scale: true,
        };
        assert_eq!(
            message(&Finding::new(moves).with_channel(Channel::X)),
            "X moves ±1002 µm; [motion] says ±500 µm. Correct the scale or [motion]."
        );
        let bits = vec![4, 5];
        let stuck = Finding::new(Kind::StuckBits { bits, step_um: 3.0 });
        let stuck = message(&stuck.with_channel(Channel::HallA).with_cost(2.0));
        assert!(stuck.starts_with(
            "Bits 4, 5 of Hall A never change, so the values have gaps of up to 3.00 µm. Alone it"
        ));
        let refused = Finding::new(Kind::CodesRefused { rows: 3 });
        assert!(message(&refused).ends_with("the errors leave out."));
    }
}
