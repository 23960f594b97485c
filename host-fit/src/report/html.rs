//! The report of a fit as one HTML file with its plots inside, so that it can be mailed.

use super::json::Report;
use std::fmt::Write;

const STYLE: &str = "body{font:15px/1.5 system-ui,sans-serif;max-width:1020px;margin:2em auto;padding:0 1em;color:#222}\
h1{font-size:1.5em}h2{font-size:1.15em;margin-top:2em}table{border-collapse:collapse;margin:.5em 0}\
td,th{padding:.25em .8em;border-bottom:1px solid #ddd;text-align:right}th:first-child,td:first-child{text-align:left}\
.warn{background:#fff4dc;border-left:4px solid #d90;padding:.5em 1em}svg{max-width:100%;height:auto}";

/// Writes text so that a browser shows it as it is.
fn escape(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
}

/// The page. `plots` are (caption, SVG).
pub fn page(report: &Report, logs: &[String], plots: &[(String, String)]) -> String {
    let mut out = format!(
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>Calibration {serial}</title>\
         <style>{STYLE}</style></head><body>\n<h1>Calibration of stage {serial}</h1>\n",
        serial = escape(if report.serial.is_empty() {
            "(no serial)"
        } else {
            &report.serial
        })
    );
    let _ = writeln!(
        out,
        "<p>Model ({}), solver {}, project {}, seed {}. {} rows in {} movements from {}; {} rows fitted, {} skipped. \
         Stopped: {}.</p>",
        report.model,
        escape(report.solver.as_deref().unwrap_or("-")),
        report.project.unwrap_or("-"),
        report.seed.unwrap_or(0),
        report.rows,
        report.movements,
        escape(&logs.join(", ")),
        report.train_rows,
        report.skipped_rows,
        escape(report.stopped.as_deref().unwrap_or("-")),
    );
    for warning in &report.warnings {
        let _ = writeln!(out, "<p class=\"warn\">{}</p>", escape(warning));
    }
    let _ = writeln!(
        out,
        "<h2>Errors over all rows, {}</h2>\n<table><tr><th></th><th>rms</th><th>peak</th><th>unit</th></tr>",
        report.zeros_in_words
    );
    let e = &report.errors;
    for (name, rms, peak, unit) in [
        ("X", e.x.rmse_um, e.x.peak_um, "um"),
        ("Y", e.y.rmse_um, e.y.peak_um, "um"),
        ("Rz", e.rz.rmse_urad, e.rz.peak_urad, "urad"),
    ] {
        let _ = writeln!(
            out,
            "<tr><td>{name}</td><td>{rms:.3}</td><td>{peak:.3}</td><td>{unit}</td></tr>"
        );
    }
    out.push_str("</table>\n<h2>Parameters</h2>\n<table><tr><th></th><th>value</th><th>standard error</th><th>unit</th></tr>\n");
    for (name, p) in &report.parameters {
        let error = p
            .standard_error
            .map_or_else(|| "-".to_owned(), |e| format!("{e:.2e}"));
        let _ = writeln!(
            out,
            "<tr><td>{name}</td><td>{:.6}</td><td>{error}</td><td>{}</td></tr>",
            p.value, p.unit
        );
    }
    out.push_str("</table>\n");
    for (caption, svg) in plots {
        let _ = writeln!(out, "<h2>{}</h2>\n{svg}", escape(caption));
    }
    out.push_str("<h2>Zero deviations, um</h2>\n<table><tr><th>movement</th><th>A</th><th>B</th><th>C</th></tr>\n");
    for zero in &report.zero_deviations {
        let _ = writeln!(
            out,
            "<tr><td>{}</td><td>{:.2}</td><td>{:.2}</td><td>{:.2}</td></tr>",
            escape(&zero.movement),
            zero.a_um,
            zero.b_um,
            zero.c_um
        );
    }
    out.push_str("</table>\n</body></html>\n");
    out
}
