//! A host and a node on one bus, in memory: the host's own script against the firmware's own node, with a
//! bad bus, a second host, and faults of the program.

mod alone;
mod world;

use hal_adapters::can::update::Key;
use host_fit::bus::update::UpdateSettings;
use runtime::ParameterSet;
use runtime::blob::MAX_BYTES;

const OLD: &[u8] = include_bytes!("../../../runtime/examples/stage.bin");
const NEW: &[u8] = include_bytes!("../../../runtime/examples/field.bin");
const SERIAL: &str = "HS-0007";
const KEY: Key = *b"a key for a test";

fn plan(blob: &[u8]) -> UpdateSettings {
    UpdateSettings {
        blob: Some(blob.to_vec()),
        serial: Some(SERIAL.to_owned()),
        key: Some(KEY),
        declares_servo_off: true,
        activates: false,
    }
}

fn activating(plan: UpdateSettings) -> UpdateSettings {
    UpdateSettings {
        activates: true,
        ..plan
    }
}

/// Without a declaration that the servo is off.
fn undeclared(plan: UpdateSettings) -> UpdateSettings {
    UpdateSettings {
        declares_servo_off: false,
        ..plan
    }
}

/// For the stage with this serial number.
fn for_serial(serial: Option<&str>, plan: UpdateSettings) -> UpdateSettings {
    let serial = serial.map(str::to_owned);
    UpdateSettings { serial, ..plan }
}

/// A sound blob with a change.
fn changed(blob: &[u8], change: impl FnOnce(&mut ParameterSet)) -> Vec<u8> {
    let mut set = ParameterSet::from_bytes(blob).expect("sound");
    change(&mut set);
    let mut buffer = [0; MAX_BYTES];
    set.to_bytes(&mut buffer).expect("it fits").to_vec()
}
