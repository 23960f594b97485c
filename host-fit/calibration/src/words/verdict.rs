//! The meaning of a verdict.

use crate::diagnose::Diagnosis;
use crate::judge::in_motion::UpTo;

/// The errors in service, and how far from the temperature of the log they hold; `is_field` for the field model, which is
/// made for service.
pub fn verdict(diagnosis: &Diagnosis, is_field: bool) -> String {
    let Some(predicted) = &diagnosis.predicted else {
        return "the log does not show the errors in service".to_owned();
    };
    if !is_field {
        let range = |[low, high]: [f64; 2]| match high > 1.05 * low {
            true => format!("{:.1} to {:.1}", low * 1e6, high * 1e6),
            false => format!("{:.1}", high * 1e6),
        };
        let [x, y, rz] = predicted.range.map(range);
        return format!(
            "for movements like the log; in service expect {x} µm in X, {y} µm in Y, {rz} µrad in Rz"
        );
    }
    let ratio = predicted.worst_ratio();
    let repaired = match diagnosis.repair {
        Some(_) => "; errors on the log include its faults, the calibration is free of them",
        None => "",
    };
    let followed = diagnosis
        .validity
        .filter(|validity| validity.is_followed && validity.within_k > 0.0);
    let within = followed.map_or(String::new(), |validity| {
        let within_k = validity.within_k;
        format!("; good within {within_k:.0} K of the temperature of calibration")
    });
    let moves = diagnosis.up_to.filter(|up_to| up_to.speed_m_s > 0.0);
    let motion = moves.map_or(String::new(), |motion| format!("; {}", up_to(&motion)));
    format!(
        "errors in service of {ratio:.2} times the noise of the sensors{repaired}{within}{motion}"
    )
}

/// A blob is judged on logs that it was fitted to.
pub fn own_logs(names: &[String]) -> String {
    let names = names.join(", ");
    format!(
        "The parameter blob was fitted to {names}: the errors there verify nothing. Judge it on another log."
    )
}

/// The largest motion with good errors.
pub fn up_to(motion: &UpTo) -> String {
    let (acceleration, speed) = (motion.acceleration_m_s2, motion.speed_m_s * 1e3);
    let open = match motion.shows_acceleration {
        true => "",
        false => "; the log does not show the effect of more acceleration",
    };
    let digits = usize::from(speed < 10.0);
    format!("good up to {acceleration:.2} m/s² and {speed:.digits$} mm/s rms{open}")
}
