//! Every command that writes, killed at any time, on a full disk, and beside another: each output is the old
//! one or the new one, whole.
//!
//! ```sh
//! KILLS=1000 cargo test -p host-fit --test program -- killed --nocapture
//! ```

use crate::common::{Bench, shipped_log, stderr, thinned_log};
use hal_adapters::can::{BusFrame, Layout, sensor};
use hal_adapters::candump::LogLine;
use rand::rngs::ChaCha8Rng;
use rand::{Rng, SeedableRng};
use runtime::RawFrame;
use std::fmt::Write as _;
use std::io::Write as _;
use std::process::Stdio;
use std::time::{Duration, Instant};

/// Kills where nothing else is asked for.
const KILLS: u64 = 60;
const SEED: u64 = 14;
/// What stands in the place of each output before.
const OLD: &[u8] = b"what was there before";

/// A command, and what it writes.
struct Job {
    arguments: &'static str,
    outputs: Vec<&'static str>,
}

/// A command and its outputs, in a line. The last two write many files one after the other.
const JOBS: &str = "\
fit log.csv --out o.bin --json o.json --report o > o.json o/index.html o.bin
fit run.csv.gz --model field --out o.bin > o.bin.posterior o.bin
recalibrate field.bin run.csv.gz --what all --out o.bin --json o.json > o.json o.bin.posterior o.bin
decode p.bin log.csv --out o.csv > o.csv
eval p.bin log.csv --json o.json > o.json
check log.csv --json o.json > o.json
import bus.log ifm.csv --out o.csv > o.csv
inspect p.bin --json o.json > o.json
diff p.bin field.bin --json o.json > o.json
export p.bin --format hex --slot 0 --out o.hex > o.hex
init log.csv --out o.toml --force > o.toml
plan --seconds 8 --out o.csv > o.csv
simulate --protocol service --seed 1 --out o.csv --truth o.truth > o.csv o.truth
man --out o > o/host-fit.1 o/host-fit-fit.1
demo --out d > d/params.bin d/pose.csv d/field.bin";

fn jobs() -> Vec<Job> {
    let job = |line: &'static str| {
        let (arguments, outputs) = line.split_once(" > ").expect(line);
        let outputs = outputs.split(' ').collect();
        Job { arguments, outputs }
    };
    JOBS.lines().map(job).collect()
}

/// A record of the bus, and the interferometers beside it: one movement of 1.5 s.
fn records() -> (String, String) {
    let mut bus = String::new();
    let mut reference = "movement,t_us,ifm_x_nm,ifm_y1_nm,ifm_y2_nm\n".to_owned();
    for tick in 0..750 {
        let time_us = 2_000 * tick;
        let angle = f64::from(tick) / 40.0;
        let (x_nm, y_nm) = (2e5 * angle.sin(), 2e5 * angle.cos());
        // 62.5 nm a code.
        let frame = RawFrame::new(
            [y_nm, y_nm, x_nm].map(|nm| (nm / 62.5).round() as i32),
            [100, 101, 99],
            tick,
            time_us,
        );
        for coded in sensor::frames(Layout::Bits16, &frame) {
            let line = LogLine {
                time_us: time_us.into(),
                interface: "can0",
                frame: BusFrame::from(coded),
            };
            writeln!(bus, "{line}").expect("a string");
        }
        writeln!(reference, "0,{time_us},{x_nm:.1},{y_nm:.1},{y_nm:.1}").expect("a string");
    }
    (bus, reference)
}

/// Every input, and every output as it was before.
fn bench() -> Bench {
    let bench = Bench::with_log();
    bench.write("run.csv.gz", host_fit::input::shipped::RUN_GZ);
    let (bus, reference) = records();
    bench.write("bus.log", bus);
    bench.write("ifm.csv", reference);
    std::fs::create_dir(bench.path("o")).expect("a folder");
    bench.good("demo --out d");
    bench.good("fit log.csv --out p.bin");
    bench.good("fit run.csv.gz --model field --out field.bin");
    bench
}

impl Job {
    fn restore(&self, bench: &Bench) {
        for output in &self.outputs {
            bench.write(output, OLD);
        }
    }

    fn start(&self, bench: &Bench) -> std::process::Child {
        let mut command = bench.command(self.arguments);
        command.stdout(Stdio::null()).stderr(Stdio::null());
        command.spawn().expect("the program runs")
    }

    /// Runs it to its end; gives its time and the new outputs.
    fn finish(&self, bench: &Bench) -> (Duration, Vec<Vec<u8>>) {
        self.restore(bench);
        let started = Instant::now();
        let output = bench.run(self.arguments);
        let message = stderr(&output);
        assert_eq!(
            output.status.code(),
            Some(0),
            "{}: {message}",
            self.arguments
        );
        let time = started.elapsed();
        (
            time,
            self.outputs
                .iter()
                .map(|output| bench.read(output))
                .collect(),
        )
    }

    /// How many outputs are old, and how many are new and whole.
    fn judge(&self, bench: &Bench, whole: &[Vec<u8>]) -> (u64, u64) {
        let (mut old, mut new) = (0, 0);
        for (output, whole) in self.outputs.iter().zip(whole) {
            let found = bench.read(output);
            if found == OLD {
                old += 1;
                continue;
            }
            // Some hold the time that the run took.
            let lines = |bytes: &[u8]| bytes.iter().filter(|byte| **byte == b'\n').count();
            let is_whole = match *output {
                output if output.ends_with(".json") => {
                    serde_json::from_slice::<serde_json::Value>(&found).is_ok()
                }
                "o/table.md" | "o/runs.csv" => {
                    found.ends_with(b"\n") && lines(&found) == lines(whole)
                }
                _ => found == *whole,
            };
            assert!(is_whole, "{output} of {} is not whole", self.arguments);
            new += 1;
        }
        (old, new)
    }
}

/// New files on their way, in the folder and those in it.
fn left_behind(bench: &Bench) -> usize {
    let folders = [".", "o", "d"].map(|folder| bench.path(folder));
    let entries = folders
        .iter()
        .flat_map(|folder| std::fs::read_dir(folder).expect("listed"));
    let names = entries.map(|entry| entry.expect("an entry").file_name());
    names
        .filter(|name| name.to_string_lossy().starts_with(".host-fit-"))
        .count()
}

#[test]
fn a_killed_command_leaves_each_output_old_or_new_and_the_next_one_sweeps() {
    let kills = std::env::var("KILLS").map_or(KILLS, |kills| kills.parse().expect("a number"));
    let bench = bench();
    let mut random = ChaCha8Rng::seed_from_u64(SEED);
    let jobs = jobs();
    let (mut ended, mut old, mut new, mut left) = (0, 0, 0, 0);
    for (k, job) in jobs.iter().enumerate() {
        let (time, whole) = job.finish(&bench);
        for _ in (k as u64..kills).step_by(jobs.len()) {
            job.restore(&bench);
            let mut running = job.start(&bench);
            // One in two near the end, where it writes.
            let [when, late] =
                [0; 2].map(|_: u32| f64::from(random.next_u32()) / f64::from(u32::MAX));
            let share = if late < 0.5 {
                1.1 * when
            } else {
                0.7 + 0.4 * when
            };
            std::thread::sleep(time.mul_f64(share));
            running.kill().expect("killed or ended");
            let status = running.wait().expect("it ends");
            ended += u64::from(status.code() == Some(0));
            let (of_old, of_new) = job.judge(&bench, &whole);
            (old, new) = (old + of_old, new + of_new);
            left += left_behind(&bench);
        }
        job.finish(&bench);
        assert_eq!(left_behind(&bench), 0, "{}", job.arguments);
    }
    println!(
        "RESULT kills={kills} ended_before={ended} outputs_old={old} outputs_new={new} outputs_broken=0 swept={left}"
    );
}

/// A shell whose files cannot grow beyond so many blocks of 512 bytes, as on a full disk.
#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_leaves_every_output_of_a_command_as_it_was() {
    let bench = bench();
    let mut full = 0;
    let jobs = jobs();
    // The others write one after the other: each is whole.
    let one_by_one = jobs.len() - 2;
    for (k, job) in jobs.iter().enumerate() {
        let (_, whole) = job.finish(&bench);
        let mut blocks: Vec<_> = whole.iter().map(|bytes| (bytes.len() - 1) / 512).collect();
        blocks.push(0);
        for blocks in blocks {
            job.restore(&bench);
            let script = format!("trap '' XFSZ; ulimit -f {blocks}; exec \"$0\" \"$@\"");
            let mut limited = std::process::Command::new("sh");
            limited.args(["-c", &script, env!("CARGO_BIN_EXE_host-fit")]);
            limited
                .args(job.arguments.split(' '))
                .current_dir(bench.path("."));
            let output = limited.output().expect("sh runs");
            let errors = stderr(&output);
            assert_eq!(output.status.code(), Some(3), "{}: {errors}", job.arguments);
            assert!(errors.contains("no room"), "{}: {errors}", job.arguments);
            assert!(!errors.contains(".host-fit-"), "a temporary name: {errors}");
            let (old, new) = job.judge(&bench, &whole);
            if k < one_by_one {
                assert_eq!(new, 0, "{} with {blocks} blocks", job.arguments);
            }
            full += old;
        }
        assert_eq!(left_behind(&bench), 0, "{}", job.arguments);
    }
    println!("RESULT full_disk outputs_old={full} outputs_broken=0");
}

#[test]
fn of_two_writers_of_an_output_each_writes_it_whole() {
    let bench = Bench::new();
    let short = thinned_log(5, |_| true);
    bench.write("short.csv", &short);
    bench.write("long.csv", shipped_log());
    bench.good("fit short.csv --out p.bin");
    let [short_whole, long_whole] = ["short", "long"].map(|log| {
        bench.good(&format!("decode p.bin {log}.csv --out whole.csv"));
        bench.read("whole.csv")
    });
    let (mut stalled, mut pipe) = bench.reading("decode p.bin - --out o.csv");
    let (begin, rest) = short.as_bytes().split_at(short.len() / 2);
    // More than a pipe holds: it has begun, and has its output open.
    pipe.write_all(begin).expect("read");
    bench.good("decode p.bin long.csv --out o.csv");
    assert!(bench.read("o.csv") == long_whole);
    pipe.write_all(rest).expect("read");
    drop(pipe);
    assert!(stalled.wait().expect("it ends").success());
    assert!(bench.read("o.csv") == short_whole);
    assert!(bench.holds_only(&["short.csv", "long.csv", "p.bin", "whole.csv", "o.csv"]));
}
