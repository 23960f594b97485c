//! What the log holds, over time.

use super::{Log, PLANAR};
use crate::report::chart::Chart;

/// Reference and Hall signals, as the paper's Fig. 9, and the vertical pose.
pub(in crate::report) fn charts(log: &Log) -> Vec<Chart> {
    let rows = &log.dataset.rows;
    let micro = |x: f64| Some(x * 1e6);
    let chart = |caption: &str, labels, of: &dyn Fn(usize, usize) -> f64| {
        log.over_time(caption.to_owned(), labels, None, |row, k| micro(of(row, k)))
    };
    vec![
        chart(
            "Displacements by the interferometers (Fig. 9 a-c of the paper)",
            PLANAR,
            &|row, k| rows[row].reference[k],
        ),
        chart(
            "Hall signals at the designed scale (Fig. 9 d-f)",
            ["A, um", "B, um", "C, um"],
            &|row, k| rows[row].signal_m[k],
        ),
        chart(
            "Vertical pose by the capacitive sensors",
            ["Z, um", "Rx, urad", "Ry, urad"],
            &|row, k| rows[row].vertical[k],
        ),
    ]
}
