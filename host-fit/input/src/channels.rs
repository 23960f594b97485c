//! Each column of a log alone: what its values show without a model and before a fit.
//!
//! | module | what it does |
//! |---|---|
//! | `signal` | the values of one channel, in runs of consecutive rows |
//! | `noise` | white noise from fifth differences |

mod noise;
mod signal;

use crate::channel::Channel;
use crate::dataset::Dataset;
use crate::stage::Stage;
use signal::Signal;

/// One channel of one log.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    /// The log: an index into [`Dataset::logs`].
    pub log: usize,
    /// The channel.
    pub channel: Channel,
    /// Its white noise from fifth differences, m; `None` without six consecutive rows.
    pub white_noise_m: Option<f64>,
}

/// The channels of all logs, log after log, in the order of [`Channel::SINGLE`]: beams only if the log has a reference, gaps only if
/// it has codes.
pub fn columns(dataset: &Dataset, stage: &Stage) -> Vec<Column> {
    let mut columns = Vec::new();
    for (log, source) in dataset.logs.iter().enumerate() {
        let runs = signal::runs(dataset, source);
        let signals = signal::signals(dataset, stage, source, &runs);
        columns.extend(signals.iter().map(|signal| Column::new(log, signal)));
    }
    columns
}

impl Column {
    fn new(log: usize, signal: &Signal) -> Self {
        Self {
            log,
            channel: signal.channel,
            white_noise_m: noise::white(signal).map(|noise| noise * signal.unit_m),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::{self, ReadOptions};
    use crate::shipped::{RUN_GZ, stage};

    /// The run of the shipped log has noise of 8 Hall codes, 6 nm and one gap code.
    #[test]
    fn white_noise_is_the_noise_of_the_sensors_while_the_stage_moves() {
        let stage = stage();
        let reading = log::read_bytes(RUN_GZ, "run30.csv.gz".as_ref(), &stage, &ReadOptions::FIT);
        let dataset = reading.expect("a log").dataset;
        let units_m = [stage.hall.m_per_count, 1e-9, stage.capacitive.m_per_count];
        for (k, column) in columns(&dataset, &stage).iter().enumerate() {
            let noise = column.white_noise_m.expect("rows") / units_m[k / 3];
            let near = [7.5..8.5, 5.5..6.5, 0.7..1.3][k / 3].contains(&noise);
            assert!(near, "{:?}: {noise}", column.channel);
        }
    }
}
