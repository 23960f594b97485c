//! Tables for a terminal.

use crate::diagnose::trusted::Trusted;
use crate::judge::lag::ReferenceLag;
use crate::judge::statistics::PoseError;
use crate::problem::model::{COUNT, Model};
use crate::problem::parameters::Parameters;
use crate::problem::terms::shown;
use crate::report::json::Report;
use crate::solve::field::fit::FieldFit;
use crate::solve::field::terms::{BEYOND_MODEL_31, PER_PROBE, TERMS};
use std::fmt::Write;

/// Errors by axis, as Tables 2, 4 and 8 of the paper show them; `paper` stands beside them as
/// (rms, peak) of X, Y (um) and Rz (urad).
pub fn errors(title: &str, error: &PoseError, paper: Option<[(f64, f64); 3]>) -> String {
    let mut out = format!("{title}\n");
    let beside = if paper.is_some() {
        "   paper: rms      peak"
    } else {
        ""
    };
    let _ = writeln!(out, "  {:<10}{:>10}{:>10}{beside}", "", "rms", "peak");
    for (axis, (name, unit)) in [("X", "um"), ("Y", "um"), ("Rz", "urad")]
        .iter()
        .enumerate()
    {
        let a = error.axes[axis];
        let label = format!("{name} ({unit})");
        let _ = write!(
            out,
            "  {label:<10}{:>10.3}{:>10.3}",
            a.rms * 1e6,
            a.peak * 1e6
        );
        if let Some(paper) = paper {
            let (rms, peak) = paper[axis];
            let _ = write!(out, "   {rms:>10.4}{peak:>10.4}");
        }
        out.push('\n');
    }
    out
}

/// Parameters beside the designed ones (Table 7), angles in degrees as the paper prints them;
/// `paper` holds its values in the same order and units.
pub fn parameters(
    model: &'static Model,
    fitted: &Parameters,
    designed: &Parameters,
    standard_error: &[Option<f64>; COUNT],
    paper: Option<&[f64]>,
) -> String {
    let mut out = String::new();
    let beside = if paper.is_some() { "       paper" } else { "" };
    let _ = writeln!(
        out,
        "  {:<14}{:>13}{:>13}{:>13}  {:<6}{beside}",
        "", "value", "std. error", "designed", "unit"
    );
    for id in model.parameters() {
        let k = id.index;
        let (scale, unit) = shown(1.0, id.term.unit);
        let error =
            standard_error[k].map_or_else(|| "-".to_owned(), |e| format!("{:.2e}", e * scale));
        let digits = if id.is_slope() { 3 } else { 6 };
        let _ = write!(
            out,
            "  {:<14}{:>13.digits$}{error:>13}{:>13.digits$}  {unit:<6}",
            id.name(),
            fitted.values[k] * scale,
            designed.values[k] * scale
        );
        if let Some(paper) = paper.and_then(|paper| paper.get(k)) {
            let _ = write!(out, "{paper:>12.4}");
        }
        out.push('\n');
    }
    out
}

/// What the field model has beyond Model (31): its terms with their standard errors.
pub fn field(fit: &FieldFit) -> String {
    let errors = fit.posterior.standard_errors();
    let mut out = format!("\n  {:<14}", "field terms");
    for probe in ["A", "B", "C"] {
        let _ = write!(out, "{probe:>11}{:>10}", "std. err.");
    }
    out.push_str("  unit\n");
    for (k, term) in TERMS.iter().enumerate().skip(BEYOND_MODEL_31) {
        let _ = write!(out, "  {:<14}", term.name);
        for (probe, values) in fit.parameters.probes.iter().enumerate() {
            let error = errors[probe * PER_PROBE + k];
            let _ = write!(out, "{:>11.6}{error:>10.1e}", values[k]);
        }
        let _ = writeln!(out, "  {}", term.unit);
    }
    out
}

/// What the standard errors are, correlations, rows that count less, and errors on rows left out.
pub fn trust(report: &Report) -> String {
    let mut out = String::new();
    if let Some(kind) = report.standard_errors {
        let _ = writeln!(out, "standard errors: {kind}");
    }
    let pairs = report.correlations.iter();
    let pairs = pairs.map(|c| {
        format!(
            "{} {} {:+.3}",
            c.parameters[0], c.parameters[1], c.correlation
        )
    });
    let pairs: Vec<String> = pairs.collect();
    if !pairs.is_empty() {
        let _ = writeln!(out, "correlations above 0.95: {}", pairs.join(", "));
    }
    if let (Some(rows), Some(loss)) = (report.outlier_rows, report.loss) {
        let _ = writeln!(
            out,
            "loss {loss}: {rows} rows count less than half; the errors above are over all rows"
        );
    }
    if let Some(c) = &report.cross_validation {
        let (out_of, fit) = (c.left_out, c.in_fit);
        let _ = writeln!(
            out,
            "cross-validation, {} groups by {}: rms {:.3} um, {:.3} um, {:.3} urad on rows left out, {:.3} um, {:.3} um, \
             {:.3} urad in the fit",
            c.groups,
            c.split,
            out_of.x_um,
            out_of.y_um,
            out_of.rz_urad,
            fit.x_um,
            fit.y_um,
            fit.rz_urad
        );
    }
    out
}

/// The lag of the reference, which may have been compensated.
pub fn lag(lag: Option<ReferenceLag>, compensated: bool) -> String {
    let Some(lag) = lag else {
        return "lag of the reference: no motion shows it\n".to_owned();
    };
    let (value, error) = (lag.value_s * 1e6, lag.standard_error_s * 1e6);
    let done = if compensated { ", compensated" } else { "" };
    format!("lag of the reference {value:.1} us, standard error {error:.1} us{done}\n")
}

/// The inputs that no log shows to be wrong, with what an error of 1 % costs.
pub fn trusted(inputs: &[Trusted]) -> String {
    let mut out = String::new();
    if !inputs.is_empty() {
        out.push_str(
            "trusted, for no log shows an error in it; 1 % costs at the ends of the range\n",
        );
    }
    for input in inputs {
        let _ = writeln!(out, "  {}", input.as_text());
    }
    out
}
