//! A host and a node on one bus, in memory: the host's own script against the firmware's own
//! node, with a lossy bus, two hosts, resets, and a recording played again.

mod alone;
mod hosts;
mod world;

use hal_adapters::can::update::Key;
use host_fit::bus::update::{Plan, Wanted};
use runtime::ParameterSet;
use runtime::blob::MAX_BYTES;

const OLD: &[u8] = include_bytes!("../../../runtime/examples/stage.bin");
const NEW: &[u8] = include_bytes!("../../../runtime/examples/field.bin");
const SERIAL: &str = "HS-0007";
const KEY: Key = *b"a key for a test";

fn plan(blob: &[u8]) -> Plan {
    Plan {
        wanted: Wanted::Blob(blob.to_vec()),
        serial: Some(SERIAL.to_owned()),
        key: Some(KEY),
        declares_servo_off: true,
        activates: false,
    }
}

fn back() -> Plan {
    Plan {
        wanted: Wanted::Previous,
        ..plan(&[])
    }
}

/// A blob of the same length that differs.
fn like(blob: &[u8]) -> Vec<u8> {
    let mut set = ParameterSet::from_bytes(blob).expect("sound");
    set.fit.rows += 1;
    let mut buffer = [0; MAX_BYTES];
    let other = set.to_bytes(&mut buffer).expect("it fits").to_vec();
    assert_eq!(other.len(), blob.len());
    other
}
