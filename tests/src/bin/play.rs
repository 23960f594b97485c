//! Plays a `candump -L` log that begins at time 0 onto a CAN interface, many frames in a call: for `tests/vcan`.
//! `canplayer`, with a call for each frame, does not reach 20 times real time there.
//!
//!     play INTERFACE LOG

use hal_adapters::can::{BusFrame, NodeNumber};
use hal_adapters::candump::LogLine;
use hal_adapters::socketcan::SocketCan;
use std::error::Error;
use std::process::ExitCode;
use std::time::{Duration, Instant};

/// Most frames in a call.
const BATCH: usize = 60;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    tests::exit("play", run(&arguments))
}

fn run(arguments: &[String]) -> Result<bool, Box<dyn Error>> {
    let [interface, log] = arguments else {
        return Err("use: play INTERFACE LOG".into());
    };
    let text = std::fs::read_to_string(log)?;
    let lines: Vec<LogLine<'_>> = text.lines().map(LogLine::parse).collect::<Result<_, _>>()?;
    let bus = SocketCan::open(interface, NodeNumber::default(), &[])?;
    let started = Instant::now();
    let mut left = &lines[..];
    while let [first, ..] = left {
        let now_us = started.elapsed().as_micros() as u64;
        let due = left.partition_point(|line| line.time_us <= now_us);
        if due == 0 {
            std::thread::sleep(Duration::from_micros(first.time_us - now_us));
            continue;
        }
        let (now, later) = left.split_at(due.min(BATCH));
        let frames: Vec<BusFrame> = now.iter().map(|line| line.frame).collect();
        bus.send_all(&frames, Duration::from_secs(1))?;
        left = later;
    }
    Ok(true)
}
