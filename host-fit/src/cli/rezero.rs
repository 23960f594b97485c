//! `host-fit rezero`.

use super::interrupt;
use super::key::KeyFile;
use crate::bus::BusAddress;
use crate::bus::update::{RezeroSettings, on, talk_to};
use crate::cli::error::HostError;
use crate::cli::terminal;
use clap::Args;

/// Arguments of `rezero`.
#[derive(Debug, Args)]
pub(super) struct RezeroArgs {
    /// CAN interface, for instance can0; can0@5 for node 5 of the bus.
    #[arg(long, value_name = "IFACE")]
    can: BusAddress,
    #[command(flatten)]
    key: KeyFile,
    /// Declare that the servo is off, for the time of the re-zero. Switch it off first.
    #[arg(long)]
    servo_off: bool,
    /// Subtract nothing any more.
    #[arg(long)]
    clear: bool,
}

/// Makes the pose at rest the zero, or clears it.
pub(super) fn run(args: &RezeroArgs) -> Result<(), HostError> {
    let zero = RezeroSettings {
        key: args.key.read()?,
        declares_servo_off: args.servo_off,
        clears: args.clear,
    };
    let watch = interrupt::watch();
    talk_to(&args.can, watch, "re-zeroing", |talk, _| {
        on::rezero(talk, &zero)
    })?;
    terminal::print(match args.clear {
        true => "the zero is cleared\n",
        false => "re-zeroed: the pose at rest is zero\n",
    })
}
