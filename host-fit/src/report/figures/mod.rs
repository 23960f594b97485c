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

use super::axis::Axis;
use super::chart::{Chart, Mark, Panel, Scale, Tone};
use crate::input::dataset::Dataset;

/// X, Y, Rz as errors are shown.
const PLANAR: [&str; 3] = ["X, um", "Y, um", "Rz, urad"];
/// Half the width of the band of the noise, standard deviations.
const BAND: f64 = 2.0;
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
        noise: Option<[f64; 3]>,
        of: impl Fn(usize, usize) -> Option<f64>,
    ) -> Chart {
        let end_s = self.times_s.last().map_or(self.period_s, |&end_s| end_s);
        let end_s = end_s.max(self.period_s);
        let panel = |k: usize| {
            let lines = super::series::lines(&self.times_s, |row| of(row, k));
            let lines = lines.into_iter().map(|line| Mark::Line(Tone::Data, line));
            let band = noise
                .into_iter()
                .flat_map(|noise| noise_band((0.0, end_s), noise[k]));
            Panel {
                label: labels[k].to_owned(),
                scale: Scale::Symmetric,
                marks: std::iter::once(self.borders())
                    .chain(lines)
                    .chain(band)
                    .collect(),
            }
        };
        Chart {
            caption,
            x_label: "time, s".to_owned(),
            x: Axis::Linear(0.0, end_s),
            panels: [0, 1, 2].map(panel).into(),
        }
    }
}

/// Both ends of the band of the noise (m or rad), in um or urad, between two abscissae.
fn noise_band((left, right): (f64, f64), noise: f64) -> [Mark; 2] {
    [-1.0, 1.0].map(|side| {
        let end = side * BAND * noise * 1e6;
        Mark::Line(Tone::Second, vec![(left, end), (right, end)])
    })
}
