//! `host-fit live`.

use super::arguments::{hold, seconds};
use super::interrupt;
use crate::bus::BusAddress;
use crate::bus::live::{self, LiveSettings};
use crate::cli::error::HostError;
use clap::Args;
use runtime::OnInvalid;
use std::path::PathBuf;
use std::time::Duration;

/// Arguments of `live`.
#[derive(Debug, Args)]
pub(super) struct LiveArgs {
    /// CAN interface, for instance can0; can0@5 for node 5 of the bus.
    #[arg(long, value_name = "IFACE")]
    can: BusAddress,
    /// The parameter blob.
    #[arg(value_name = "params.bin")]
    params: PathBuf,
    /// Refuse a blob unless its stage has this serial number.
    #[arg(long, value_name = "TEXT")]
    serial: Option<String>,
    /// Record every frame received and sent, as `candump -L` does, in a new file.
    #[arg(long, value_name = "FILE")]
    record: Option<PathBuf>,
    /// Repeat the last valid pose for at most N ticks where codes are bad.
    #[arg(long, value_name = "N", default_value = "0", value_parser = hold)]
    hold: OnInvalid,
    /// Send nothing: only watch, record and show.
    #[arg(long)]
    listen_only: bool,
    /// End after this many seconds; without it, on Ctrl-C.
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    duration: Option<Duration>,
    /// Seconds from line to line, where lines are shown.
    #[arg(long, value_name = "SECONDS", default_value = "1", value_parser = seconds)]
    every: Duration,
    /// Show lines on a terminal, too, in place of the scope.
    #[arg(long)]
    plain: bool,
    /// Give up a tick if frames are still missing after this time.
    #[arg(long, value_name = "US", default_value_t = 1_000, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    assembly_us: u32,
    /// Call the sensors stale after this time without a good frame.
    #[arg(long, value_name = "US", default_value_t = 3_000, value_parser = clap::value_parser!(u32).range(1..=10_000_000))]
    stale_us: u32,
}

impl LiveArgs {
    fn settings(&self) -> LiveSettings {
        LiveSettings {
            can: self.can.clone(),
            params: self.params.clone(),
            serial: self.serial.clone(),
            record: self.record.clone(),
            hold: self.hold,
            listen_only: self.listen_only,
            duration: self.duration,
            every: self.every,
            plain: self.plain,
            assembly_us: self.assembly_us,
            stale_us: self.stale_us,
        }
    }
}

/// Decodes a bus.
pub(super) fn run(args: &LiveArgs) -> Result<(), HostError> {
    super::check_outputs([args.record.as_deref()], None, [args.params.as_path()])?;
    Ok(live::run(&args.settings(), interrupt::watch().stop)?)
}
