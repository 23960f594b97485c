//! Each output of a command is old, or new and whole, after a kill at any time and on a full disk.
//!
//! ```sh
//! KILLS=1000 cargo test -p host-fit --test program -- killed --nocapture
//! ```

use crate::common::{Bench, shipped_log, stderr, thinned_log};
use rand::rngs::ChaCha8Rng;
use rand::{Rng, SeedableRng};
use std::io::Write as _;
use std::process::Stdio;
use std::time::Instant;

/// Kills where nothing else is asked for.
const KILLS: u64 = 20;
const SEED: u64 = 14;
/// The content of each output before.
const OLD: &[u8] = b"what was there before";

/// A command that writes a blob with its posterior and two more files, and one that writes row by row.
const COMMANDS: [(&str, &[&str]); 2] = [
    (
        "fit run.csv.gz --model field --out o.bin --json o.json --report o --force",
        &["o.json", "o/index.html", "o.bin.posterior", "o.bin"],
    ),
    ("decode p.bin log.csv --out o.csv --force", &["o.csv"]),
];

fn bench() -> Bench {
    let bench = Bench::new();
    bench.write("log.csv", shipped_log());
    bench.write("run.csv.gz", host_fit::input::shipped::RUN_GZ);
    bench.good("fit log.csv --model 31 --out p.bin");
    std::fs::create_dir(bench.path("o")).expect("a folder");
    bench
}

/// Whether each output is new, which must be whole; else it must be old.
fn are_new(bench: &Bench, outputs: &[&str], whole: &[Vec<u8>]) -> Vec<bool> {
    let is_new = |(output, whole): (&&str, &Vec<u8>)| {
        let found = bench.read(output);
        // The time that the run took is in the JSON.
        let is_json = output.ends_with(".json");
        let is_whole = match is_json {
            true => serde_json::from_slice::<serde_json::Value>(&found).is_ok(),
            false => found == *whole,
        };
        assert!(
            is_whole || found == OLD,
            "{output} is neither old nor whole"
        );
        is_whole
    };
    outputs.iter().zip(whole).map(is_new).collect()
}

#[test]
fn a_killed_command_leaves_each_output_old_or_new() {
    let kills = std::env::var("KILLS").map_or(KILLS, |kills| kills.parse().expect("a number"));
    let bench = bench();
    let mut random = ChaCha8Rng::seed_from_u64(SEED);
    for (arguments, outputs) in COMMANDS {
        let started = Instant::now();
        bench.good(arguments);
        let time = started.elapsed();
        let whole: Vec<_> = outputs.iter().map(|output| bench.read(output)).collect();
        for k in 0..kills / COMMANDS.len() as u64 {
            outputs
                .iter()
                .for_each(|output| drop(bench.write(output, OLD)));
            let mut command = bench.command(arguments);
            command.stdout(Stdio::null()).stderr(Stdio::null());
            let mut running = command.spawn().expect("the program runs");
            // Every second kill comes near the end, where files are written.
            let share = f64::from(random.next_u32()) / f64::from(u32::MAX);
            let share = if k % 2 == 0 {
                0.7 + 0.4 * share
            } else {
                1.1 * share
            };
            std::thread::sleep(time.mul_f64(share));
            running.kill().expect("killed or ended");
            running.wait().expect("it ends");
            are_new(&bench, outputs, &whole);
        }
    }
}

/// Files cannot grow beyond a number of blocks of 512 bytes, as on a full disk.
#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_leaves_every_output_as_it_was() {
    let bench = bench();
    for (arguments, outputs) in COMMANDS {
        bench.good(arguments);
        let whole: Vec<_> = outputs.iter().map(|output| bench.read(output)).collect();
        for blocks in whole.iter().map(|bytes| (bytes.len() - 1) / 512).chain([0]) {
            outputs
                .iter()
                .for_each(|output| drop(bench.write(output, OLD)));
            let script = format!("trap '' XFSZ; ulimit -f {blocks}; exec \"$0\" \"$@\"");
            let mut limited = std::process::Command::new("sh");
            limited.args(["-c", &script, env!("CARGO_BIN_EXE_host-fit")]);
            limited
                .args(arguments.split(' '))
                .current_dir(bench.path("."));
            let output = limited.output().expect("sh runs");
            let errors = stderr(&output);
            assert_eq!(output.status.code(), Some(3), "{arguments}: {errors}");
            assert!(errors.contains("no room"), "{arguments}: {errors}");
            assert!(!errors.contains(".host-fit-"), "a temporary name: {errors}");
            let new = are_new(&bench, outputs, &whole);
            assert!(!new.contains(&true), "{arguments} with {blocks} blocks");
        }
    }
}

#[test]
fn two_writers_of_one_output_each_write_it_whole() {
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
}
