//! The figures of a report.
//!
//! | module | what it draws |
//! |---|---|
//! | [`signals`] | what the log holds, as the paper's Fig. 9 |
//! | [`errors`] | errors over time, before and after, as Figs 10 to 12; by movement; their distribution |
//! | [`residuals`] | what is left against everything that it may depend on, and its spectrum |
//! | [`fitting`] | the course of the search, and the zero deviations |

pub(super) mod errors;
pub(super) mod fitting;
pub(super) mod residuals;
pub(super) mod signals;

use super::chart::{Chart, Mark, Panel, Scale, Tone};
use crate::input::dataset::Dataset;

/// X, Y, Rz as errors are shown.
const PLANAR: [&str; 3] = ["X, um", "Y, um", "Rz, urad"];
/// Movements up to which their borders and bars can be told apart.
const MOVEMENTS_SHOWN: usize = 150;

/// A log and the abscissa of everything that is shown over time.
pub(super) struct Log<'a> {
    pub(super) dataset: &'a Dataset,
    /// Time of every row, s.
    pub(super) times_s: Vec<f64>,
    /// Time between rows, s.
    pub(super) period_s: f64,
}

impl Log<'_> {
    /// Where movements begin, unless there are too many to be told apart.
    fn borders(&self) -> Mark {
        let starts = self.dataset.movements.iter().skip(1).map(|m| m.rows.start);
        let starts = starts.filter_map(|row| self.times_s.get(row).copied());
        let few = self.dataset.movements.len() <= MOVEMENTS_SHOWN;
        Mark::Borders(Tone::Grid, starts.filter(|_| few).collect())
    }

    /// Panels over time; `of` gives the value of a row in a panel.
    fn over_time(
        &self,
        caption: String,
        labels: [&str; 3],
        behind: [Option<Mark>; 3],
        of: impl Fn(usize, usize) -> Option<f64>,
    ) -> Chart {
        let panel = |(k, behind): (usize, Option<Mark>)| {
            let lines = super::series::lines(&self.times_s, |row| of(row, k));
            let lines = lines.into_iter().map(|line| Mark::Line(Tone::Data, line));
            Panel {
                label: labels[k].to_owned(),
                scale: Scale::Symmetric,
                marks: behind
                    .into_iter()
                    .chain([self.borders()])
                    .chain(lines)
                    .collect(),
            }
        };
        let end_s = self.times_s.last().copied().unwrap_or(0.0);
        Chart {
            caption,
            x_label: "time, s".to_owned(),
            x: (0.0, end_s.max(self.period_s)),
            x_logarithmic: false,
            panels: behind.into_iter().enumerate().map(panel).collect(),
        }
    }
}
