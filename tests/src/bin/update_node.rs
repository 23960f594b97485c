//! A node that takes new parameters over a CAN interface, until it is killed: for `tests/vcan`.
//!
//!     update_node INTERFACE params.bin SERIAL [KEY]
//!
//! `KEY`: 32 hexadecimal digits. Every record is lost when it ends.

use hal_adapters::can::{BusFrame, Coded, Message};
use hal_adapters::socketcan::SocketCan;
use std::error::Error;
use std::process::ExitCode;
use std::time::{Duration, Instant};
use tests::node::{Node, TICKS_PER_S};

const TICK: Duration = Duration::from_micros(1_000_000 / TICKS_PER_S as u64);
/// How long it is deaf after a reset.
const START: Duration = Duration::from_millis(200);
const SEND_DEADLINE: Duration = Duration::from_millis(20);

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let (interface, params, serial, key) = match &arguments[..] {
        [interface, params, serial] => (interface, params, serial, None),
        [interface, params, serial, key] => match u128::from_str_radix(key, 16) {
            Ok(key) => (interface, params, serial, Some(key.to_be_bytes())),
            Err(error) => {
                eprintln!("update_node: {key}: {error}");
                return ExitCode::from(2);
            }
        },
        _ => {
            eprintln!("use: update_node INTERFACE params.bin SERIAL [KEY]");
            return ExitCode::from(2);
        }
    };
    match run(interface, params, serial.clone().leak(), key) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("update_node: {error}");
            ExitCode::from(3)
        }
    }
}

fn run(
    interface: &str,
    params: &str,
    serial: &'static str,
    key: Option<[u8; 16]>,
) -> Result<(), Box<dyn Error>> {
    let blob = std::fs::read(params)?;
    let seed = u64::from(std::process::id());
    let mut node = Node::new(serial, key, (1, &blob), seed)?;
    let mut bus = SocketCan::open(interface, &[Message::Command, Message::UpdateData])?;
    let send = |bus: &SocketCan, coded: Option<Coded>| match coded {
        Some(coded) => bus.send(&BusFrame::from(coded), SEND_DEADLINE),
        None => Ok(()),
    };
    println!("ready");
    let mut next = Instant::now() + TICK;
    for tick in 0u64.. {
        while let Some(wait) = next.checked_duration_since(Instant::now()) {
            if let Some(stamped) = bus.receive(wait)? {
                send(&bus, node.take(&stamped.frame))?;
            }
        }
        next += TICK;
        send(&bus, node.tick())?;
        if tick.is_multiple_of(16) {
            send(&bus, node.status())?;
        }
        if node.wants_reset() {
            node.reset();
            std::thread::sleep(START);
            while bus.receive(Duration::ZERO)?.is_some() {}
            next = Instant::now() + TICK;
        }
    }
    Ok(())
}
