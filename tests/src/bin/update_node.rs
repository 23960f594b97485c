//! The stage controller's program without its chip, on a CAN interface until it is killed: for
//! `tests/vcan`. Its poses are of codes that are made up.
//!
//!     update_node INTERFACE params.bin SERIAL [KEY]
//!
//! `KEY`: 32 hexadecimal digits. `params.bin` lies in its first slot as a probe flashes it; its flash is lost when it
//! ends.

use hal_adapters::can::{BusFrame, Message, NodeNumber};
use hal_adapters::socketcan::SocketCan;
use std::collections::VecDeque;
use std::error::Error;
use std::process::ExitCode;
use std::time::{Duration, Instant};
use tests::flash_model::FlashModel;
use tests::node::{Node, TAKEN_PER_TICK};

/// How long it is deaf after a reset, and while it erases a sector.
const START: Duration = Duration::from_millis(200);
const ERASE: Duration = Duration::from_millis(500);
const SEND_DEADLINE: Duration = Duration::from_millis(20);

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    tests::exit("update_node", run(&arguments))
}

fn run(arguments: &[String]) -> Result<bool, Box<dyn Error>> {
    let (interface, params, serial, key) = match arguments {
        [interface, params, serial] => (interface, params, serial, None),
        [interface, params, serial, key] => {
            let key = Box::leak(Box::new(u128::from_str_radix(key, 16)?.to_be_bytes()));
            (interface, params, serial, Some(&*key))
        }
        _ => return Err("use: update_node INTERFACE params.bin SERIAL [KEY]".into()),
    };
    let serial: &'static str = serial.clone().leak();
    let mut flash = FlashModel::erased();
    flash.load(0, &std::fs::read(params)?);
    let mut node = Node::new(Some(serial), key, flash, u64::from(std::process::id()));
    let mut bus = SocketCan::open(
        interface,
        NodeNumber::default(),
        &[Message::Command, Message::UpdateData],
    )?;
    println!("ready");
    let started = Instant::now();
    let now_us = || started.elapsed().as_micros() as u32;
    let mut received = VecDeque::new();
    loop {
        // However late it is on a busy machine, the bus is looked at.
        loop {
            let left_us = node.due_us().wrapping_sub(now_us()).cast_signed();
            let left_us = left_us.max(0).cast_unsigned();
            match bus.receive(Duration::from_micros(left_us.into()))? {
                Some(stamped) => received.push_back(stamped.frame),
                None if left_us == 0 => break,
                None => {}
            }
        }
        let taken = received.len().min(TAKEN_PER_TICK);
        let late_us = now_us().wrapping_sub(node.due_us());
        let stored = node.tick(late_us, received.drain(..taken));
        while let Some(coded) = node.send() {
            bus.send(&BusFrame::from(coded), SEND_DEADLINE)?;
        }
        let deaf = match node.is_to_be_reset() {
            true => Some(START),
            false => Some(ERASE).filter(|_| stored),
        };
        if let Some(deaf) = deaf {
            if !stored {
                node.reset(START.as_micros() as u32);
            }
            std::thread::sleep(deaf);
            received.clear();
            while bus.receive(Duration::ZERO)?.is_some() {}
        }
    }
}
