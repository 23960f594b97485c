//! Time and memory of `fit` and `decode` from two minutes of log to a day: the shipped log, repeated
//! with new movement numbers and times.
//!
//! ```sh
//! cargo bench -p host-fit --bench long_logs             # up to an hour: 0.2 GB of disk
//! cargo bench -p host-fit --bench long_logs -- day      # up to a day: 6 GB
//! ```
//!
//! Logs and poses lie in `target/long_logs`, and are removed. Prints `RESULT key=value` lines and
//! draws `target/long_logs.svg`. Memory is the kernel's high-water mark (Linux).

use flate2::read::GzDecoder;
use host_fit::input::shipped::{LOG_GZ, STAGE_TOML};
use host_fit::report::axis::Axis;
use host_fit::report::chart::{Chart, Mark, Panel, Scale, Tone};
use std::error::Error;
use std::fs::File;
use std::io::{BufWriter, Read, Write};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// Rows of the shipped log, and its length.
const ROWS: usize = 57_000;
const LOG_US: u64 = 57 * 2_000_000;
/// Logs of so many repetitions: two minutes, six, an hour, a day.
const REPEATED: [usize; 5] = [1, 4, 10, 32, 758];

/// What a command took.
#[derive(Clone, Copy)]
struct Taken {
    seconds: f64,
    megabytes: f64,
}

fn main() -> Result<(), Box<dyn Error>> {
    let a_day = std::env::args().any(|argument| argument == "day");
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../target/long_logs");
    std::fs::create_dir_all(&folder)?;
    std::fs::write(folder.join("stage.toml"), STAGE_TOML)?;
    let mut shipped = String::new();
    GzDecoder::new(LOG_GZ).read_to_string(&mut shipped)?;
    let mut points = Vec::new();
    for times in &REPEATED[..REPEATED.len() - usize::from(!a_day)] {
        let rows = times * ROWS;
        write_log(&shipped, *times, &folder.join("log.csv"))?;
        let fit = run(&folder, "fit log.csv --stage stage.toml --out p.bin")?;
        let decode = run(
            &folder,
            "decode p.bin log.csv --stage stage.toml --out pose.csv",
        )?;
        println!(
            "RESULT rows={rows} fit_s={:.2} fit_mb={:.0} decode_s={:.2} decode_mb={:.0} decoded_rows_per_s={:.2e}",
            fit.seconds,
            fit.megabytes,
            decode.seconds,
            decode.megabytes,
            rows as f64 / decode.seconds
        );
        points.push((rows as f64, fit, decode));
    }
    std::fs::remove_dir_all(&folder)?;
    Ok(plot(&points, &folder.with_extension("svg"))?)
}

/// The shipped log so many times, one after the other.
fn write_log(shipped: &str, times: usize, path: &Path) -> Result<(), Box<dyn Error>> {
    let mut out = BufWriter::new(File::create(path)?);
    let (header, rows) = shipped.split_once('\n').ok_or("no header")?;
    writeln!(out, "{header}")?;
    for k in 0..times {
        for row in rows.lines() {
            let (movement, rest) = row.split_once(',').ok_or("no movement")?;
            let (t_us, rest) = rest.split_once(',').ok_or("no time")?;
            let movement = movement.parse::<usize>()? + 57 * k;
            let t_us = t_us.parse::<u64>()? + LOG_US * k as u64;
            writeln!(out, "{movement},{t_us},{rest}")?;
        }
    }
    Ok(out.flush()?)
}

/// Runs a command of `host-fit`; the memory is read every 5 ms while it runs.
fn run(folder: &Path, arguments: &str) -> Result<Taken, Box<dyn Error>> {
    let started = Instant::now();
    let mut child = Command::new(env!("CARGO_BIN_EXE_host-fit"))
        .args(arguments.split(' '))
        .current_dir(folder)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()?;
    let status = format!("/proc/{}/status", child.id());
    let mut kilobytes = 0;
    let ended = loop {
        let now = std::fs::read_to_string(&status).unwrap_or_default();
        let line = now.lines().find_map(|line| line.strip_prefix("VmHWM:"));
        let now_kb = line.and_then(|line| line.trim_end_matches(" kB").trim().parse().ok());
        kilobytes = kilobytes.max(now_kb.unwrap_or(0));
        if let Some(ended) = child.try_wait()? {
            break ended;
        }
        std::thread::sleep(Duration::from_millis(5));
    };
    if !ended.success() {
        return Err(format!("host-fit {arguments}: {ended}").into());
    }
    Ok(Taken {
        seconds: started.elapsed().as_secs_f64(),
        megabytes: f64::from(kilobytes) / 1e3,
    })
}

/// Both commands over the rows, on logarithmic axes: time above, memory below.
fn plot(points: &[(f64, Taken, Taken)], path: &Path) -> std::io::Result<()> {
    let panel = |label: &str, of: fn(&Taken) -> f64| {
        let fit = points.iter().map(|(rows, fit, _)| (*rows, of(fit)));
        let decode = points.iter().map(|(rows, _, decode)| (*rows, of(decode)));
        Panel {
            label: label.to_owned(),
            scale: Scale::Logarithmic,
            marks: vec![
                Mark::Line(Tone::Of(0), fit.collect()),
                Mark::Line(Tone::Of(1), decode.collect()),
            ],
        }
    };
    let chart = Chart {
        caption: "fit and decode over the length of a log".to_owned(),
        x_label: "rows".to_owned(),
        x: Axis::Logarithmic(4e4, 6e7),
        panels: vec![
            panel("s", |taken| taken.seconds),
            panel("MB", |taken| taken.megabytes),
        ],
    };
    std::fs::write(path, chart.svg_file(&[(0, "fit"), (1, "decode")]))
}
