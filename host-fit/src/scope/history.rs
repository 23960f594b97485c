//! The rows of a scope so far, and the window of them that is shown.

use super::trace::Scale;
use runtime::frame::MISSING_CODE;
use std::collections::VecDeque;

/// Most rows that are kept: half an hour at 500 Hz.
const ROWS_MAX: usize = 1 << 20;
/// Fewest rows of a window.
const WINDOW_MIN: usize = 64;
/// Rows of the first window: four seconds at 500 Hz.
const WINDOW: usize = 2048;
/// A motion shows the direction of a probe from this range, m, and from this correlation with the reference on.
const MOTION_MIN_M: f64 = 1e-5;
const CLEAR: f64 = 0.8;

/// One row for a scope.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScopeRow {
    /// Time, us.
    pub t_us: f64,
    /// Codes of the Hall probes A, B, C and of the gaps 1, 2, 3.
    pub codes: [i32; 6],
    /// Readings of the designed probes at the reference pose, m, if there is a reference.
    pub designed_m: Option<[f64; 3]>,
}

/// Rows and the window that is shown.
#[derive(Clone, Debug)]
pub struct History {
    /// The name of the source.
    pub title: String,
    /// The sensors, in the order of the codes.
    pub scales: [Scale; 6],
    /// The usual time between rows, s.
    pub period_s: f64,
    /// What the source says of its state.
    pub state: String,
    rows: VecDeque<ScopeRow>,
    /// Number of rows in the window.
    length: usize,
    /// Rows after the window.
    behind: usize,
    /// Whether the window stays where it is while rows come.
    pub(super) is_frozen: bool,
    /// Rows that came, and rows that are missing between them.
    pub(super) counts: [u64; 2],
}

impl History {
    /// Without rows.
    pub fn new(title: String, scales: [Scale; 6], period_s: f64) -> Self {
        Self {
            title,
            scales,
            period_s,
            state: String::new(),
            rows: VecDeque::new(),
            length: WINDOW,
            behind: 0,
            is_frozen: false,
            counts: [0; 2],
        }
    }

    /// Adds a row; the oldest of too many is dropped.
    pub fn push(&mut self, row: ScopeRow) {
        let [rows, missing] = &mut self.counts;
        *rows += 1;
        if let Some(before) = self.rows.back() {
            let periods = ((row.t_us - before.t_us) / (1e6 * self.period_s)).round();
            // A clock that starts again is no gap.
            *missing += if periods > 1.0 { periods as u64 - 1 } else { 0 };
        }
        if self.rows.len() == ROWS_MAX {
            self.rows.pop_front();
        }
        self.rows.push_back(row);
        self.behind += usize::from(self.is_frozen);
        self.move_by(0);
    }

    /// Moves the window by a number of its halves, to later rows if positive.
    pub(super) fn move_by(&mut self, halves: isize) {
        let most = self.rows.len().saturating_sub(self.length);
        let half = self.length / 2 * halves.unsigned_abs();
        self.behind = match halves < 0 {
            true => self.behind.saturating_add(half),
            false => self.behind.saturating_sub(half),
        };
        self.behind = self.behind.min(most);
    }

    /// Shows the newest rows.
    pub(super) fn follow(&mut self) {
        (self.behind, self.is_frozen) = (0, false);
    }

    /// Halves or doubles the window.
    pub(super) fn zoom(&mut self, is_longer: bool) {
        let length = if is_longer {
            2 * self.length
        } else {
            self.length / 2
        };
        self.length = length.clamp(WINDOW_MIN, ROWS_MAX);
        self.move_by(0);
    }

    /// The rows of the window.
    pub(super) fn window(&self) -> impl ExactSizeIterator<Item = &ScopeRow> + Clone {
        let end = self.rows.len() - self.behind.min(self.rows.len());
        self.rows.range(end.saturating_sub(self.length)..end)
    }

    /// The codes of one sensor in the window, without rows that have none.
    pub(super) fn codes(&self, sensor: usize) -> Vec<i32> {
        let codes = self.window().map(|row| row.codes[sensor]);
        codes.filter(|code| *code != MISSING_CODE).collect()
    }

    /// What the motion of a Hall probe in the window says of its wires: inverted, or like another probe.
    pub(super) fn wires(&self, probe: usize) -> Option<String> {
        let correlation = |other: usize| {
            let pairs = self.window().filter_map(|row| {
                let designed_m = row.designed_m?;
                Some((f64::from(row.codes[probe]), designed_m[other]))
            });
            let pairs: Vec<(f64, f64)> = pairs.collect();
            let designed = || pairs.iter().map(|(_, designed_m)| *designed_m);
            let range_m = designed().fold(f64::MIN, f64::max) - designed().fold(f64::MAX, f64::min);
            let is_clear = pairs.len() >= WINDOW_MIN && range_m > MOTION_MIN_M;
            is_clear.then(|| correlation(&pairs)).flatten()
        };
        let of = [correlation(0)?, correlation(1)?, correlation(2)?];
        let strongest = (0..3).max_by(|a, b| of[*a].abs().total_cmp(&of[*b].abs()))?;
        let names = ["A", "B", "C"];
        match of[probe] {
            own if own < -CLEAR => Some("INVERTED".to_owned()),
            own if own.abs() < CLEAR && of[strongest].abs() > CLEAR => {
                Some(format!("MOVES LIKE {}", names[strongest]))
            }
            _ => None,
        }
    }
}

/// The correlation of pairs; `None` if one side does not change.
fn correlation(pairs: &[(f64, f64)]) -> Option<f64> {
    let count = pairs.len() as f64;
    let a = pairs.iter().map(|(p, _)| p).sum::<f64>() / count;
    let b = pairs.iter().map(|(_, q)| q).sum::<f64>() / count;
    let (mut pp, mut pq, mut qq) = (0.0, 0.0, 0.0);
    for (p, q) in pairs {
        let (p, q) = (p - a, q - b);
        pp += p * p;
        pq += p * q;
        qq += q * q;
    }
    (pp * qq > 0.0).then(|| pq / (pp * qq).sqrt())
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use runtime::frame::CodeWindow;
    use std::f64::consts::TAU;

    /// Without rows, in um of 0.1 a code.
    pub(in crate::scope) fn empty() -> History {
        let window = CodeWindow {
            low: -9_999,
            high: 9_999,
        };
        let scales = Scale::six("\u{b5}m", [(0.1, window); 2]);
        History::new("run.csv".to_owned(), scales, 0.002)
    }

    /// A row of a stage that moves; `sense` is how each probe follows its designed reading.
    pub(in crate::scope) fn row(k: u32, sense: impl Fn([f64; 3]) -> [f64; 3]) -> ScopeRow {
        let wave = |hz: f64| 3e3 * (TAU * hz * 0.002 * f64::from(k)).sin();
        let noise = |at: u32| f64::from((k * 6 + at).wrapping_mul(2_654_435_761) >> 29);
        let designed = [wave(0.7), wave(0.5), wave(0.3)];
        let [a, b, c] = sense(designed);
        let codes = [a, b, c, 100.0, 200.0, 300.0];
        ScopeRow {
            t_us: 2e3 * f64::from(k),
            codes: std::array::from_fn(|at| (codes[at] + noise(at as u32)) as i32),
            designed_m: Some(designed.map(|code| 1e-7 * code)),
        }
    }

    #[test]
    fn inverted_and_exchanged_probes_are_named_and_sound_ones_are_not() {
        for (sense, want) in [
            ((|q| q) as fn([f64; 3]) -> [f64; 3], [None, None, None]),
            (|[a, b, c]| [a, -b, c], [None, Some("INVERTED"), None]),
            (
                |[a, b, c]| [b, a, c],
                [Some("MOVES LIKE B"), Some("MOVES LIKE A"), None],
            ),
            (|[a, b, _]| [a, b, 0.0], [None, None, None]),
        ] {
            let mut history = empty();
            (0..4_000).for_each(|k| history.push(row(k, sense)));
            let said = [0, 1, 2].map(|probe| history.wires(probe));
            assert_eq!(said.each_ref().map(Option::as_deref), want);
        }
    }

    #[test]
    fn noise_of_a_stage_at_rest_names_no_probe() {
        let mut history = empty();
        let at_rest = |k: u32| ScopeRow {
            designed_m: Some([1e-9 * f64::from(k); 3]),
            ..row(k, |[a, b, c]| [-a, -b, -c])
        };
        (0..500).for_each(|k| history.push(at_rest(k)));
        assert_eq!(
            [0, 1, 2].map(|probe| history.wires(probe)),
            [None, None, None]
        );
    }

    #[test]
    fn a_window_follows_freezes_moves_and_zooms() {
        let mut history = empty();
        let first = |history: &History| history.window().next().map(|row| row.t_us / 2e3);
        (0..5_000).for_each(|k| history.push(row(k, |q| q)));
        assert_eq!(first(&history), Some((5_000 - WINDOW) as f64));
        history.is_frozen = true;
        history.push(row(5_000, |q| q));
        assert_eq!(first(&history), Some((5_000 - WINDOW) as f64));
        history.move_by(-100);
        assert_eq!(first(&history), Some(0.0));
        history.follow();
        history.zoom(false);
        assert_eq!(history.window().len(), WINDOW / 2);
        assert_eq!(first(&history), Some((5_001 - WINDOW / 2) as f64));
        history.push(row(5_011, |q| q));
        assert_eq!(history.counts, [5_002, 10]);
    }
}
