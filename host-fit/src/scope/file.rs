//! A scope on a log, also while the log grows.

use super::{History, Scale, ScopeRow, Screen, Wish};
use hallstage_input::dataset::Row;
use hallstage_input::log::layout::LogLayout;
use hallstage_input::log::table::Table;
use hallstage_input::log::{BadRows, LogError, LogProblem, LogRows, ReadOptions};
use hallstage_input::source::{SourceError, SourceProblem};
use hallstage_input::stage::Stage;
use hallstage_input::text::TextReader;
use nalgebra::Vector3;
use runtime::frame::CodeWindow;
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Time between two looks at the log and the keys.
const LOOK: Duration = Duration::from_millis(100);

/// Rows that show their period.
const PERIOD_ROWS: usize = 3;

/// Rows that cannot be read are left out, rows at a rail are shown.
const OPTIONS: ReadOptions = ReadOptions {
    bad_rows: BadRows::Skip,
    ..ReadOptions::DECODE
};

/// Why a scope of a log ended early.
#[derive(Debug, thiserror::Error)]
pub enum ScopeError {
    /// The log cannot be read.
    #[error(transparent)]
    Log(#[from] LogError),
    /// The terminal cannot be used.
    #[error("the terminal cannot be used: {0}; a scope needs a terminal of 80 by 24 characters")]
    Terminal(#[from] io::Error),
}

/// Shows a log until the user ends it.
///
/// # Errors
/// See [`ScopeError`].
pub fn run(path: &Path, stage: &Stage, stop: &AtomicBool) -> Result<(), ScopeError> {
    let mut log = GrowingLog::new(path, stage);
    let name = path
        .file_name()
        .unwrap_or_default()
        .to_string_lossy()
        .into_owned();
    let mut history = History::new(name, scales(stage), stage.servo_period_s);
    log.read_on(&mut history)?;
    let mut screen = Screen::open()?;
    while !stop.load(Ordering::Relaxed) {
        screen.draw(&history)?;
        if screen.keys(&mut history, LOOK)? == Wish::Quit {
            break;
        }
        log.read_on(&mut history)?;
    }
    Ok(())
}

fn scales(stage: &Stage) -> [Scale; 6] {
    let converters = [&stage.hall, &stage.capacitive];
    Scale::six(
        "\u{b5}m",
        converters.map(|converter| (1e6 * converter.m_per_count, converter.window)),
    )
}

/// A scale of a vertical pose in nm or nrad.
const fn of_pose(name: &'static str, unit: &'static str) -> Scale {
    Scale {
        name,
        per_code: 1e-3,
        unit,
        window: CodeWindow {
            low: i32::MIN,
            high: i32::MAX,
        },
    }
}

/// The scales of a vertical pose.
const POSE: [Scale; 3] = [
    of_pose("Z", "\u{b5}m"),
    of_pose("Rx", "\u{b5}rad"),
    of_pose("Ry", "\u{b5}rad"),
];

/// A log that is read to its last whole line, again and again.
struct GrowingLog<'s> {
    path: PathBuf,
    stage: &'s Stage,
    /// The lines above the rows, once they are known.
    head: Option<Vec<u8>>,
    /// Bytes of the file that were taken.
    taken: u64,
}

impl<'s> GrowingLog<'s> {
    fn new(path: &Path, stage: &'s Stage) -> Self {
        Self {
            path: path.to_path_buf(),
            stage,
            head: None,
            taken: 0,
        }
    }

    /// Adds the rows that came since the last time.
    ///
    /// # Errors
    /// Errors of a log. A log without rows yet is none.
    fn read_on(&mut self, history: &mut History) -> Result<(), LogError> {
        let bytes = self.new_lines().map_err(|error| self.refused(error))?;
        if bytes.is_empty() {
            return Ok(());
        }
        let head = match &self.head {
            Some(head) => head.clone(),
            None => {
                let text = TextReader::from_reader(&*bytes, &self.path)?;
                let layout: &LogLayout = &self.stage.log;
                let lines = match Table::open(text, |name| layout.knows(name)) {
                    // Comments so far.
                    Err(LogError {
                        problem: LogProblem::Empty,
                        ..
                    }) => {
                        self.taken = 0;
                        return Ok(());
                    }
                    table => table?.row_line(),
                };
                let above = bytes.split_inclusive(|byte| *byte == b'\n').take(lines);
                self.head = Some(above.flatten().copied().collect());
                Vec::new()
            }
        };
        let text = TextReader::from_reader(head.chain(&*bytes), &self.path)?;
        let mut rows = LogRows::new(text, "reading", self.stage, &OPTIONS)?;
        let has_reference = rows.has_reference();
        let plane = self.stage.geometry().plane();
        if bytes.iter().filter(|byte| **byte == b'\n').count() > PERIOD_ROWS {
            history.period_s = 1e-6 * rows.period_us();
        }
        while let Some(found) = rows.next_row()? {
            let Row {
                t_us,
                frame,
                reference,
                vertical,
                ..
            } = found.row;
            let hall = frame.hall();
            let gaps = frame.capacitive().unwrap_or_else(|| {
                history.scales[3..].copy_from_slice(&POSE);
                vertical.map(|x| (1e9 * x) as i32)
            });
            history.push(ScopeRow {
                t_us: t_us as f64,
                codes: [hall[0], hall[1], hall[2], gaps[0], gaps[1], gaps[2]],
                designed_m: has_reference.then(|| (plane * Vector3::from(reference)).into()),
            });
        }
        Ok(())
    }

    /// The whole lines that were added; all of a file that is packed.
    fn new_lines(&mut self) -> io::Result<Vec<u8>> {
        let mut file = File::open(&self.path)?;
        if file.metadata()?.len() < self.taken {
            // The log begins anew.
            (self.taken, self.head) = (0, None);
        }
        file.seek(SeekFrom::Start(self.taken))?;
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes)?;
        // Gzip and UTF-16 cannot be cut at a byte.
        let marks: [&[u8]; 3] = [&[0x1f, 0x8b], &[0xff, 0xfe], &[0xfe, 0xff]];
        let is_whole = self.taken == 0 && marks.iter().any(|mark| bytes.starts_with(mark));
        if !is_whole {
            let whole = bytes
                .iter()
                .rposition(|byte| *byte == b'\n')
                .map_or(0, |end| end + 1);
            bytes.truncate(whole);
        }
        self.taken += bytes.len() as u64;
        Ok(bytes)
    }

    fn refused(&self, source: io::Error) -> LogError {
        let problem = match source.kind() {
            io::ErrorKind::NotFound => SourceProblem::NotFound,
            _ => SourceProblem::Unreadable { source },
        };
        SourceError {
            path: self.path.clone(),
            problem,
        }
        .into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hallstage_input::shipped::{RUN_GZ, stage};
    use std::io::Write;

    /// The text of the log that ships with the program.
    fn log() -> String {
        let mut text = TextReader::from_reader(RUN_GZ, Path::new("run")).expect("text");
        let mut bytes = Vec::new();
        while text.append(&mut bytes, 1 << 20).expect("text") {}
        String::from_utf8(bytes).expect("text")
    }

    #[test]
    fn rows_come_as_whole_lines_are_added() {
        let (stage, log) = (stage(), log());
        let mut file = tempfile::NamedTempFile::new().expect("a file");
        let path = file.path().to_path_buf();
        let mut growing = GrowingLog::new(&path, &stage);
        let mut history = History::new(String::new(), scales(&stage), 1.0);
        let mut rows = |piece: &str| {
            file.write_all(piece.as_bytes()).expect("written");
            growing.read_on(&mut history).map(|()| history.counts[0])
        };
        let ends: Vec<usize> = log.match_indices('\n').map(|(at, _)| at + 1).collect();
        assert_eq!(rows("").expect("empty"), 0);
        assert_eq!(rows(&log[..ends[100]]).expect("rows"), 100);
        // A line that is still being written waits.
        let cut = ends[200] - 7;
        assert_eq!(rows(&log[ends[100]..cut]).expect("rows"), 199);
        assert_eq!(rows(&log[cut..ends[300]]).expect("rows"), 300);
        assert_eq!(rows("").expect("nothing new"), 300);
        assert_eq!(history.counts[1], 0, "none is missing");
        assert!((history.period_s - stage.servo_period_s).abs() < 1e-9);
        assert_eq!(
            [0, 1, 2].map(|probe| history.wires(probe)),
            [None, None, None]
        );
        let first = history.window().next().expect("rows");
        assert!(first.designed_m.is_some());
    }

    #[test]
    fn comments_wait_for_a_header_and_a_log_may_begin_anew() {
        let (stage, log) = (stage(), log());
        let file = tempfile::NamedTempFile::new().expect("a file");
        let mut growing = GrowingLog::new(file.path(), &stage);
        let mut history = History::new(String::new(), scales(&stage), 1.0);
        let mut rows = |text: &str| {
            std::fs::write(file.path(), text).expect("written");
            growing.read_on(&mut history).map(|()| history.counts)
        };
        let ends: Vec<usize> = log.match_indices('\n').map(|(at, _)| at + 1).collect();
        assert_eq!(rows("# by hand\n").expect("comments"), [0, 0]);
        let noted = format!("# by hand\n{}", &log[..ends[100]]);
        assert_eq!(rows(&noted).expect("rows"), [100, 0]);
        // A shorter file is another one; its clock starts again, which is no gap.
        assert_eq!(rows(&log[..ends[50]]).expect("rows"), [150, 0]);
        assert_eq!(rows(&log[..ends[60]]).expect("rows"), [160, 0]);
    }

    #[test]
    fn a_packed_log_is_read_once_and_a_missing_one_is_named() {
        let stage = stage();
        let mut file = tempfile::NamedTempFile::new().expect("a file");
        file.write_all(RUN_GZ).expect("written");
        let mut history = History::new(String::new(), scales(&stage), 1.0);
        let mut packed = GrowingLog::new(file.path(), &stage);
        for _ in 0..2 {
            packed.read_on(&mut history).expect("a log");
            assert_eq!(history.counts, [15_001, 0]);
        }
        let error = GrowingLog::new(Path::new("/no/such/log"), &stage)
            .read_on(&mut history)
            .expect_err("no file");
        assert!(error.to_string().contains("no such file"), "{error}");
    }
}
