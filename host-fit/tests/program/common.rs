//! Runs the program in a folder of its own, on logs made from the shipped log.

use serde_json::Value;
use std::f64::consts::TAU;
use std::fmt::Write;
use std::io::{Read, Write as _};
use std::path::PathBuf;
use std::process::{Child, ChildStdin, Command, Output, Stdio};

/// A folder with `stage.toml` in it.
pub struct Bench {
    folder: tempfile::TempDir,
}

impl Bench {
    pub fn new() -> Self {
        let bench = Self {
            folder: tempfile::tempdir().expect("a folder"),
        };
        bench.write("stage.toml", host_fit::input::shipped::STAGE_TOML);
        bench
    }

    /// With every twentieth row of the shipped log in `log.csv`.
    pub fn with_log() -> Self {
        let bench = Self::new();
        bench.write("log.csv", log());
        bench
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub fn write(&self, name: &str, content: impl AsRef<[u8]>) -> PathBuf {
        let path = self.path(name);
        std::fs::write(&path, content).expect("written");
        path
    }

    pub fn read(&self, name: &str) -> Vec<u8> {
        std::fs::read(self.path(name)).expect("read")
    }

    pub fn text(&self, name: &str) -> String {
        String::from_utf8(self.read(name)).expect("text")
    }

    pub fn json(&self, name: &str) -> Value {
        serde_json::from_slice(&self.read(name)).expect("JSON")
    }

    /// Runs the program with arguments separated by spaces, in the folder.
    pub fn run(&self, arguments: &str) -> Output {
        self.command(arguments).output().expect("the program runs")
    }

    /// The program with its arguments, not yet started.
    pub fn command(&self, arguments: &str) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_host-fit"));
        // Units without signs, whatever the language of the machine.
        command.env("LC_ALL", "C");
        command.args(arguments.split_whitespace());
        command.current_dir(self.folder.path());
        command
    }

    /// Started, with a pipe to its standard input.
    pub fn reading(&self, arguments: &str) -> (Child, ChildStdin) {
        let mut command = self.command(arguments);
        command.stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut child = command.stderr(Stdio::piped()).spawn().expect("started");
        let pipe = child.stdin.take().expect("a pipe");
        (child, pipe)
    }

    /// Runs the program with this on its standard input.
    pub fn piped(&self, arguments: &str, input: &[u8]) -> Output {
        let (child, mut pipe) = self.reading(arguments);
        pipe.write_all(input).expect("read");
        drop(pipe);
        child.wait_with_output().expect("it ends")
    }

    /// The figures of a command, which must succeed.
    pub fn figures(&self, arguments: &str) -> Value {
        self.good(&format!("{arguments} --json figures.json"));
        self.json("figures.json")
    }

    /// Runs the program, which must succeed.
    pub fn good(&self, arguments: &str) -> Output {
        let output = self.run(arguments);
        assert_eq!(
            output.status.code(),
            Some(0),
            "{arguments}: {}",
            stderr(&output)
        );
        output
    }

    /// Runs the program, which must end with `status` and a message that holds all of `parts`.
    pub fn bad(&self, arguments: &str, status: i32, parts: &[&str]) {
        let output = self.run(arguments);
        let message = stderr(&output);
        assert_eq!(output.status.code(), Some(status), "{arguments}: {message}");
        for part in parts {
            assert!(
                message.contains(part),
                "{arguments}: no `{part}` in: {message}"
            );
        }
        assert!(!message.contains("panicked"), "{message}");
    }

    /// Whether a file or folder has this name.
    pub fn has(&self, name: &str) -> bool {
        self.path(name).exists()
    }

    /// rms of X, Y, Rz of a blob over a log, zero deviations refitted, um, um, urad.
    pub fn rms(&self, blob: &str, log: &str) -> [f64; 3] {
        let eval = self.figures(&format!("eval {blob} {log} --limit 100"));
        let errors = &eval["errors"];
        [("x", "rmse_um"), ("y", "rmse_um"), ("rz", "rmse_urad")]
            .map(|(axis, rms)| number(&errors[axis][rms]))
    }

    /// Whether nothing but the named files is in the folder.
    pub fn holds_only(&self, names: &[&str]) -> bool {
        let entries = std::fs::read_dir(self.folder.path()).expect("listed");
        entries.map(|e| e.expect("entry").file_name()).all(|name| {
            let known = names.iter().any(|known| name == *known);
            known || name == "stage.toml"
        })
    }
}

pub fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

pub fn stdout(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// Presses Ctrl-C.
#[cfg(unix)]
pub fn interrupt(running: &Child) {
    let mut kill = Command::new("kill");
    let sent = kill.args(["-INT", &running.id().to_string()]).status();
    assert!(sent.expect("kill runs").success());
}

/// A text must hold this.
#[track_caller]
pub fn says(text: impl AsRef<str>, part: &str) {
    let text = text.as_ref();
    assert!(text.contains(part), "no `{part}` in: {text}");
}

/// The numbers of a table below its header.
pub fn rows(table: &str) -> Vec<Vec<f64>> {
    let number = |cell: &str| cell.parse().expect("a number");
    let row = |line: &str| line.split(',').map(number).collect();
    table.lines().skip(1).map(row).collect()
}

pub fn number(value: &Value) -> f64 {
    value.as_f64().expect("a number")
}

pub fn unzipped(log: &[u8]) -> String {
    let mut text = String::new();
    let mut reader = flate2::read::GzDecoder::new(log);
    reader.read_to_string(&mut text).expect("a shipped log");
    text
}

/// The shipped log as text.
pub fn shipped_log() -> String {
    unzipped(host_fit::input::shipped::LOG_GZ)
}

/// Every twentieth row of it.
pub fn log() -> String {
    thinned_log(20, |_| true)
}

/// A run with this number of cycles of each axis over the range of service. An axis with no cycles stands still.
pub fn plan(seconds: f64, cycles: [f64; 6]) -> String {
    const AMPLITUDES: [f64; 6] = [500.0, 800.0, 500.0, 240.0, 480.0, 480.0];
    let mut csv = "t_us,x_um,y_um,rz_urad,z_um,rx_urad,ry_urad\n".to_owned();
    let rows = (seconds * 500.0) as u32;
    for row in 0..rows {
        let t_s = f64::from(row) * 0.002;
        let end = (t_s.min(seconds - t_s) / 0.5).clamp(0.0, 1.0);
        let taper = end * end * (3.0 - 2.0 * end);
        let _ = write!(csv, "{}", row * 2000);
        for (axis, amplitude) in AMPLITUDES.into_iter().enumerate() {
            let moves = if cycles[axis] > 0.0 { amplitude } else { 0.0 };
            let phase = TAU * cycles[axis] * t_s / seconds + 1.7 * axis as f64;
            let _ = write!(csv, ",{:.4}", moves * taper * phase.sin());
        }
        csv.push('\n');
    }
    csv
}

/// The shipped log with every `stride`-th row of each movement and only the movements wanted.
pub fn thinned_log(stride: usize, keep: impl Fn(usize) -> bool) -> String {
    let log = shipped_log();
    let mut lines = log.lines();
    let mut out = lines.next().expect("a header").to_owned() + "\n";
    for (row, line) in lines.enumerate() {
        let movement: usize = line
            .split(',')
            .next()
            .and_then(|m| m.parse().ok())
            .expect("a movement");
        if row % stride == 0 && keep(movement) {
            out.push_str(line);
            out.push('\n');
        }
    }
    out
}

/// A log of whole numbers, the cells of each row (from 0 after the header) changed.
pub fn changed(log: &str, change: impl Fn(usize, &mut [i64])) -> String {
    let (header, rows) = log.split_once('\n').expect("a header");
    let rows = rows.lines().enumerate().map(|(row, line)| {
        let cells = line.split(',').map(|cell| cell.parse().expect("whole"));
        let mut cells: Vec<i64> = cells.collect();
        change(row, &mut cells);
        let cells: Vec<String> = cells.iter().map(i64::to_string).collect();
        cells.join(",") + "\n"
    });
    format!("{header}\n{}", rows.collect::<String>())
}

/// The place of a column.
pub fn column(log: &str, name: &str) -> usize {
    let header = log.lines().next().expect("a header");
    let place = header.split(',').position(|column| column == name);
    place.expect("the column")
}

/// Replaces one cell of a log: row from 0 after the header, column by name.
pub fn with_cell(log: &str, row: usize, column: &str, value: &str) -> String {
    let mut lines: Vec<String> = log.lines().map(str::to_owned).collect();
    let index = self::column(log, column);
    let mut cells: Vec<&str> = lines[row + 1].split(',').collect();
    cells[index] = value;
    lines[row + 1] = cells.join(",");
    lines.join("\n") + "\n"
}
