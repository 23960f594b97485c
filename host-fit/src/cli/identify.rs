//! `host-fit identify`.

use super::args::Json;
use super::inspect::errors;
use super::report::Report;
use crate::bus::BusAddress;
use crate::bus::update::{self, Identity, RunningParameters};
use crate::cli::error::HostError;
use crate::cli::terminal;
use crate::report::table::{as_text, tables};
use clap::Args;
use hal_adapters::can::update::Kept;
use serde_json::{Value, json};

/// Arguments of `identify`.
#[derive(Debug, Args)]
pub(super) struct IdentifyArgs {
    /// CAN interface, for instance can0; can0@5 for node 5 of the bus.
    #[arg(long, value_name = "IFACE")]
    can: BusAddress,
    #[command(flatten)]
    json: Json,
}

/// Asks a controller who it is and what it runs.
pub(super) fn run(args: &IdentifyArgs) -> Result<(), HostError> {
    super::check_outputs([args.json.path.as_deref()], &Report::default(), [])?;
    let figures = figures(&update::identify(&args.can)?);
    args.json.write(&figures)?;
    terminal::print(&as_text(&tables(&figures, &["next", "newest_sequence"])))
}

fn figures(identity: &Identity) -> Value {
    let kept = |record: Kept| json!({ "sequence": record.sequence, "crc32c": format!("{:08x}", record.crc) });
    let running = identity.running.as_ref();
    let in_force = |record: &Kept| running.is_some_and(|r| r.sequence == record.sequence);
    let newest = identity.newest_sequence;
    let is_unused = newest > identity.next.map_or(0, |record| record.sequence);
    json!({
        "serial": identity.serial,
        "running": running.map(|running| json!({
            "slot": running.slot,
            "sequence": running.sequence,
            "crc32c": format!("{:08x}", running.crc),
            "bytes": running.bytes,
            "created": running.created,
            "forced": running.forced,
            "errors": errors(running.rms, running.peak),
        })),
        "newest_sequence": newest,
        "next": identity.next.map(kept),
        // Stored, and in force from the next reset on.
        "waiting": identity.next.filter(|record| !in_force(record)).map(kept),
        // Damaged, of another stage, or passed over.
        "not_used": is_unused.then(|| json!({ "sequence": newest })),
        "previous": identity.previous.map(kept),
        "program_version": identity.program_version.map(|part| part.to_string()).join("."),
        "program_hash": format!("{:08x}", identity.program_hash),
        "needs_key": identity.needs_key,
        "last_update": identity.last_update,
    })
}

/// Which parameters, in one line.
pub(super) fn parameters(running: Option<&RunningParameters>) -> String {
    let Some(running) = running else {
        return "none".to_owned();
    };
    let created = match running.created.as_str() {
        "" => String::new(),
        created => format!(", created {created}"),
    };
    let (sequence, crc) = (running.sequence, running.crc);
    format!("number {sequence}, check {crc:08x}{created}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_waits_for_a_reset_and_what_is_not_used_are_distinguished() {
        let kept = |sequence| Some(Kept { sequence, crc: 7 });
        let shown = |next, newest_sequence| {
            let running = RunningParameters {
                slot: 0,
                forced: false,
                sequence: 3,
                crc: 7,
                bytes: 500,
                created: String::new(),
                rms: [0.0; 3],
                peak: [0.0; 3],
            };
            figures(&Identity {
                serial: "HS-0007".to_owned(),
                running: Some(running),
                newest_sequence,
                next,
                previous: kept(2),
                program_version: [0; 3],
                program_hash: 0,
                needs_key: true,
                last_update: None,
            })
        };
        for (next, newest, waits, is_unused) in [
            (kept(3), 3, false, false),
            (kept(4), 4, true, false),
            (kept(3), 4, false, true),
            (kept(4), 5, true, true),
        ] {
            let found = shown(next, newest);
            assert_eq!(found["waiting"].is_object(), waits, "{found}");
            assert_eq!(found["not_used"].is_object(), is_unused, "{found}");
            assert!(found["previous"].is_object(), "{found}");
        }
    }
}
