//! The stage controller's program without its chip, on a CAN interface until it is killed: for
//! `tests/vcan`. Its poses are of codes that are made up.
//!
//!     update_node INTERFACE params.bin SERIAL [KEY]
//!
//! `KEY`: 32 hexadecimal digits. `params.bin` lies in its first slot as a probe flashes it; its flash is lost when it
//! ends.

use firmware::schedule::PERIOD_US;
use firmware::store::Sector;
use firmware::store::flash_model::FlashModel;
use hal_adapters::can::{BusFrame, Message};
use hal_adapters::socketcan::SocketCan;
use std::collections::VecDeque;
use std::error::Error;
use std::process::ExitCode;
use std::time::{Duration, Instant};
use tests::node::{Node, TAKEN_PER_TICK};

const TICK: Duration = Duration::from_micros(PERIOD_US as u64);
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
    let mut flash = FlashModel::erased();
    flash.load(Sector::First, &std::fs::read(params)?);
    let mut node = Node::new(serial, key, flash, u64::from(std::process::id()));
    let mut bus = SocketCan::open(interface, &[Message::Command, Message::UpdateData])?;
    println!("ready");
    let mut received = VecDeque::new();
    let mut next = Instant::now() + TICK;
    loop {
        while let Some(wait) = next.checked_duration_since(Instant::now()) {
            received.extend(bus.receive(wait)?.map(|stamped| stamped.frame));
        }
        next += TICK;
        let taken = received.len().min(TAKEN_PER_TICK);
        node.tick(received.drain(..taken));
        while let Some(coded) = node.send() {
            bus.send(&BusFrame::from(coded), SEND_DEADLINE)?;
        }
        if node.is_to_be_reset() {
            node.reset();
            std::thread::sleep(START);
            received.clear();
            while bus.receive(Duration::ZERO)?.is_some() {}
            next = Instant::now() + TICK;
        }
    }
}
