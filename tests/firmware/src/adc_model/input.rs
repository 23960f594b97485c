//! What is at the inputs of a converter, as a function of time, in codes of the log.

/// Hall codes A, B, C and capacitive codes 1, 2, 3.
pub type Row = [i32; 6];

/// Time from row to row, and of a servo period, ns.
const PERIOD_NS: u64 = 2_000_000;

/// The inputs.
#[derive(Default)]
pub struct Input {
    rows: Vec<Row>,
    period_ns: u64,
    moves: bool,
    /// From the first tick until row 0 is there, ns.
    after_ns: u64,
    /// When row 0 is there, once the first tick has come, ns.
    pub start_ns: Option<u64>,
}

impl Input {
    /// Each row for one period, from the tick on, in a loop: a sample that is settled within the
    /// period sees that row alone.
    pub fn held(rows: Vec<Row>) -> Self {
        Self {
            rows,
            period_ns: PERIOD_NS,
            ..Self::default()
        }
    }

    /// The same with another period.
    pub fn every(self, period_us: u64) -> Self {
        let period_ns = period_us * 1000;
        Self { period_ns, ..self }
    }

    /// A motion, linear from row to row, `period_us` apart, that starts so long after the first
    /// tick; the first row before its start and the last one after its end.
    pub fn moving(rows: Vec<Row>, period_us: u64, after_us: u64) -> Self {
        Self {
            rows,
            period_ns: period_us * 1000,
            moves: true,
            after_ns: after_us * 1000,
            start_ns: None,
        }
    }

    /// The first tick has come since a start of the program. Held rows change with its ticks.
    pub fn join(&mut self, tick_ns: u64) {
        let start_ns = *self.start_ns.get_or_insert(tick_ns + self.after_ns);
        if !self.moves {
            self.start_ns = Some(start_ns + tick_ns.saturating_sub(start_ns) % self.period_ns);
        }
    }

    /// The row that was there without a change from `from_ns` to `to_ns`.
    pub fn constant(&self, from_ns: u64, to_ns: u64) -> Option<Row> {
        let (first, last) = (self.index(from_ns), self.index(to_ns));
        (!self.moves && first == last).then(|| self.row(first))
    }

    /// The inputs at a time.
    pub fn at(&self, ns: u64) -> [f64; 6] {
        let k = self.index(ns);
        let row = self.row(k).map(f64::from);
        if !self.moves || self.start_ns.is_none_or(|start| ns < start) {
            return row;
        }
        let since = (ns - self.start_ns.unwrap_or(ns)) % self.period_ns;
        let part = since as f64 / self.period_ns as f64;
        let next = self.row(k + 1);
        let mut codes = row;
        for (code, next) in codes.iter_mut().zip(next) {
            *code += part * (f64::from(next) - *code);
        }
        codes
    }

    fn index(&self, ns: u64) -> usize {
        (ns.saturating_sub(self.start_ns.unwrap_or(ns)) / self.period_ns) as usize
    }

    fn row(&self, k: usize) -> Row {
        let count = self.rows.len().max(1);
        let k = if self.moves {
            k.min(count - 1)
        } else {
            k % count
        };
        self.rows.get(k).copied().unwrap_or_default()
    }
}
