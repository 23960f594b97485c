//! The table of channels: the properties of each column of a log.

use super::figure::{Figure, Group, figure, group};
use hallstage_input::channels::Column;
use hallstage_input::dataset::Dataset;

/// A group for each channel of each log.
pub fn channels(columns: &[Column], dataset: &Dataset) -> Vec<Group> {
    let of_column = |column: &Column| {
        let um = |m: f64| figure((m * 1e10).round() * 1e-4, "um");
        let ratio = |x: f64| figure((x * 1e3).round() * 1e-3, "");
        let several = dataset.logs.len() > 1;
        let between = |slow: bool| if slow { "held" } else { "interpolated" };
        group! {
            "channel" => column.channel.name(),
            "log" => several.then(|| dataset.logs[column.log].name()),
            "range" => Figure::from_iter(column.range_m.map(um)),
            "step" => um(column.step_m),
            "noise" => column.white_noise_m.map(um),
            "noise_to_others" => column.to_siblings.map(ratio),
            "shared_noise" => (column.shared > 0.0).then(|| ratio(column.shared)),
            "low_pass" => column.is_low_passed,
            "rows_per_value" => column.slow.map(|slow| slow.every),
            "rows_between" => column.slow.map(|slow| between(slow.is_held)),
            "straight_rows" => column.straight.as_ref().map(ExactSizeIterator::len),
            "stuck_bits" => Figure::from_iter(column.stuck_bits.iter().copied()),
            "overflows" => column.overflows.map(|(_, times)| times),
            "outliers" => column.outliers.len(),
            "line_at" => column.line.map(|line| figure((line.frequency_hz * 10.0).round() * 0.1, "Hz")),
            "line" => column.line.map(|line| um(line.amplitude_m)),
        }
    };
    columns.iter().map(of_column).collect()
}
