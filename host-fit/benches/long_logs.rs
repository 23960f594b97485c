//! Time and memory of `fit` and `decode` from two minutes of log to a day: the shipped log, repeated
//! with new movement numbers and times.
//!
//! ```sh
//! cargo bench -p host-fit --bench long_logs             # up to an hour: 0.2 GB of disk
//! cargo bench -p host-fit --bench long_logs -- day      # up to a day: 6 GB
//! ```
//!
//! Logs and poses lie in `target/long_logs` and are removed. Prints `RESULT key=value` lines. Memory is the
//! kernel's high-water mark (Linux).

use flate2::read::GzDecoder;
use host_fit::input::shipped::{LOG_GZ, STAGE_TOML};
use std::error::Error;
use std::fs::File;
use std::io::{BufWriter, Read, Write};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// Rows of the shipped log, and its length.
const ROWS: usize = 57_000;
const LOG_US: u64 = 57 * 2_000_000;
/// Repetitions of the shipped log: up to an hour, and a day.
const REPEATED: [usize; 5] = [1, 4, 10, 32, 758];

fn main() -> Result<(), Box<dyn Error>> {
    let a_day = std::env::args().any(|argument| argument == "day");
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../target/long_logs");
    std::fs::create_dir_all(&folder)?;
    std::fs::write(folder.join("stage.toml"), STAGE_TOML)?;
    let mut shipped = String::new();
    GzDecoder::new(LOG_GZ).read_to_string(&mut shipped)?;
    for times in &REPEATED[..REPEATED.len() - usize::from(!a_day)] {
        let rows = times * ROWS;
        write_log(&shipped, *times, &folder.join("log.csv"))?;
        let fit = "fit log.csv --stage stage.toml --out p.bin";
        let decode = "decode p.bin log.csv --stage stage.toml --out pose.csv";
        for (name, command) in [("fit", fit), ("decode", decode)] {
            let (seconds, megabytes) = run(&folder, command)?;
            println!("RESULT rows={rows} {name}_s={seconds:.2} {name}_mb={megabytes:.0}");
        }
    }
    Ok(std::fs::remove_dir_all(&folder)?)
}

/// Writes the shipped log several times, one after the other.
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

/// Time (s) and memory (MB) of a command of `host-fit`. The memory is read every 5 ms.
fn run(folder: &Path, arguments: &str) -> Result<(f64, f64), Box<dyn Error>> {
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
    Ok((started.elapsed().as_secs_f64(), f64::from(kilobytes) / 1e3))
}
