//! `host-fit identify`.

use super::arguments::Json;
use super::interrupt;
use crate::bus::BusAddress;
use crate::bus::update::{Identity, on, talk_to};
use crate::cli::error::HostError;
use crate::cli::terminal;
use crate::report::figure::{Group, group};
use crate::report::text::as_text;
use clap::Args;
use hal_adapters::can::update::BlobId;
use serde_json::json;

/// Arguments of `identify`.
#[derive(Debug, Args)]
pub(super) struct IdentifyArgs {
    /// CAN interface, for instance can0; can0@5 for node 5 of the bus.
    #[arg(long, value_name = "IFACE")]
    can: BusAddress,
    #[command(flatten)]
    json: Json,
}

/// Asks a controller for its identity and its parameters.
pub(super) fn run(args: &IdentifyArgs) -> Result<(), HostError> {
    super::check_outputs([args.json.path.as_deref()], None, [])?;
    args.json.check_own()?;
    let identity = talk_to(&args.can, interrupt::watch(), "asking", |talk, _| {
        on::identify(talk)
    })?;
    let figures = figures(&identity);
    args.json.write(&figures)?;
    terminal::print(&as_text(&figures.tables()))?;
    warn_without_key(&identity);
    Ok(())
}

/// Says what a controller without a key is open to.
pub(super) fn warn_without_key(identity: &Identity) {
    if !identity.needs_key {
        terminal::warn(&[
            "the controller has no key: whoever can send on its bus may replace its parameters while the servo is off"
                .to_owned(),
        ]);
    }
}

fn figures(identity: &Identity) -> Group {
    let blob =
        |id: BlobId| group! { "sequence" => id.sequence, "crc32c" => format!("{:08x}", id.crc) };
    let running = identity.running.map(|(id, bytes)| {
        let mut running = blob(id);
        running.set("bytes", bytes);
        running
    });
    let runs = |id: &BlobId| identity.running.is_some_and(|(running, _)| running == *id);
    let newest = identity.newest_sequence;
    let is_unused = newest > identity.next.map_or(0, |next| next.sequence);
    group! {
        "serial" => identity.serial.as_str(),
        "running" => running,
        "newest_sequence" => json!(newest),
        "next" => json!(identity.next.map(blob)),
        // Stored, and in force after an activation or power-on.
        "waiting" => identity.next.filter(|next| !runs(next)).map(blob),
        // Damaged, or of another stage.
        "not_used" => is_unused.then(|| group! { "sequence" => newest }),
        "program_version" => identity.program_version.map(|part| part.to_string()).join("."),
        "needs_key" => identity.needs_key,
    }
}

/// The parameters that run, in one line.
pub(super) fn parameters(identity: &Identity) -> String {
    match identity.running {
        Some((id, _)) => format!("number {}, check {:08x}", id.sequence, id.crc),
        None => "none".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_waiting_blob_and_an_unused_blob_are_distinguished() {
        let blob = |sequence| BlobId { sequence, crc: 7 };
        for (next, newest_sequence, waits, is_unused) in [
            (3, 3, false, false),
            (4, 4, true, false),
            (3, 4, false, true),
            (4, 5, true, true),
        ] {
            let shown = json!(figures(&Identity {
                serial: "HS-0007".to_owned(),
                running: Some((blob(3), 500)),
                newest_sequence,
                next: Some(blob(next)),
                program_version: [0; 3],
                needs_key: true,
            }));
            assert_eq!(shown["waiting"].is_object(), waits, "{shown}");
            assert_eq!(shown["not_used"].is_object(), is_unused, "{shown}");
        }
    }
}
