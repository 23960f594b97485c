//! Ctrl-C while a file is read.
#![cfg(unix)]

use crate::common::{Bench, interrupt, says, stderr, thinned_log};
use std::io::Write;

/// Lines that every reader leaves out, more than a pipe holds.
const LINES: usize = 20_000;
/// So much of them is written to a command that does not end: some seconds.
const TIMES_MAX: usize = 2_000;

#[test]
fn ctrl_c_ends_a_command_that_reads_and_leaves_nothing_behind() {
    let bench = Bench::new();
    let log = thinned_log(5, |_| true);
    bench.write("log.csv", &log);
    bench.write("ifm.csv", "t_us,ifm_x_nm,ifm_y1_nm,ifm_y2_nm\n0,1,2,3\n");
    bench.good("fit log.csv --model 31 --out p.bin");
    let bus = "(1.000000) can0 123#00\n";
    for (arguments, start) in [
        ("fit - --out o.bin --json o.json --report o", log.as_str()),
        ("check - --json o.json", &log),
        ("decode p.bin - --out o.csv", &log),
        ("join - ifm.csv --out o.csv --bad-rows skip", bus),
    ] {
        let (running, mut pipe) = bench.reading(arguments);
        let lines = "# nothing\n".repeat(LINES);
        // It reads, or these would not have fit into the pipe.
        pipe.write_all(start.as_bytes()).expect("read");
        pipe.write_all(lines.as_bytes()).expect("read");
        interrupt(&running);
        let ended = (0..TIMES_MAX).any(|_| pipe.write_all(lines.as_bytes()).is_err());
        drop(pipe);
        let output = running.wait_with_output().expect("ended");
        let errors = stderr(&output);
        assert!(ended, "{arguments} read on: {errors}");
        assert_eq!(output.status.code(), Some(130), "{arguments}: {errors}");
        says(&errors, "interrupted");
        assert!(bench.holds_only(&["log.csv", "ifm.csv", "p.bin"]));
    }
}
