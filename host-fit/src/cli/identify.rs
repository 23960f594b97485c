//! `host-fit identify`.

use crate::bus::update::{self, Identity, RunningParameters};
use crate::cli::error::HostError;
use crate::cli::terminal;
use clap::Args;
use hal_adapters::can::update::Kept;
use serde_json::{Value, json};
use std::path::PathBuf;

/// Arguments of `identify`.
#[derive(Debug, Args)]
pub(super) struct IdentifyArgs {
    /// CAN interface, for instance can0.
    #[arg(long, value_name = "IFACE")]
    can: String,
    /// Write everything as JSON; `-` for standard output.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// Asks a controller who it is and what it runs.
pub(super) fn run(args: &IdentifyArgs) -> Result<(), HostError> {
    super::keep_apart(&[args.json.as_deref()], &[])?;
    let identity = update::identify(&args.can)?;
    if let Some(path) = &args.json {
        super::write_json(&as_json(&identity), path)?;
    }
    terminal::print(&as_text(&identity))
}

fn as_json(identity: &Identity) -> Value {
    let axis = |running: &RunningParameters, k: usize, unit: &str| {
        let micro = |value: f32| f64::from(value) * 1e6;
        let (rms, peak) = (micro(running.rms[k]), micro(running.peak[k]));
        json!({ format!("rmse_{unit}"): rms, format!("peak_{unit}"): peak })
    };
    let running = identity.running.as_ref().map(|running| {
        json!({
            "slot": running.slot,
            "sequence": running.sequence,
            "crc32c": format!("{:08x}", running.crc),
            "bytes": running.bytes,
            "created": running.created,
            "forced": running.forced,
            "errors": {
                "x": axis(running, 0, "um"), "y": axis(running, 1, "um"), "rz": axis(running, 2, "urad"),
            },
        })
    });
    json!({
        "serial": identity.serial,
        "running": running,
        "newest_sequence": identity.newest_sequence,
        "next": identity.next.map(kept),
        "previous": identity.previous.map(kept),
        "program_version": version(identity),
        "program_hash": format!("{:08x}", identity.program_hash),
        "needs_key": identity.needs_key,
        "last_update": identity.last_update,
    })
}

fn kept(record: Kept) -> Value {
    json!({ "sequence": record.sequence, "crc32c": format!("{:08x}", record.crc) })
}

fn version(identity: &Identity) -> String {
    identity
        .program_version
        .map(|part| part.to_string())
        .join(".")
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

fn as_text(identity: &Identity) -> String {
    let mut lines = Vec::new();
    let serial = match identity.serial.as_str() {
        "" => "-",
        serial => serial,
    };
    lines.push(("stage", serial.to_owned()));
    let running = identity.running.as_ref();
    lines.push(("parameters", parameters(running)));
    if let Some(running) = running {
        let [x, y, rz] = running.rms.map(|value| value * 1e6);
        lines.push((
            "rms of fit",
            format!("X {x:.3} um, Y {y:.3} um, Rz {rz:.3} urad"),
        ));
        let [x, y, rz] = running.peak.map(|value| value * 1e6);
        lines.push((
            "peak of fit",
            format!("X {x:.3} um, Y {y:.3} um, Rz {rz:.3} urad"),
        ));
        let forced = if running.forced {
            ", of a fit that was refused"
        } else {
            ""
        };
        let (bytes, slot) = (running.bytes, running.slot);
        lines.push(("stored", format!("{bytes} bytes in sector {slot}{forced}")));
    }
    let in_force = |record: &Kept| running.is_some_and(|r| r.sequence == record.sequence);
    if let Some(Kept { sequence, crc }) = identity.next.filter(|record| !in_force(record)) {
        lines.push((
            "waiting",
            format!("number {sequence}, check {crc:08x}, for a reset"),
        ));
    }
    let (newest, next) = (identity.newest_sequence, identity.next);
    if newest > next.map_or(0, |record| record.sequence) {
        lines.push((
            "refused",
            format!("number {newest} is not used: damaged, of another stage, or passed over"),
        ));
    }
    if let Some(Kept { sequence, crc }) = identity.previous {
        lines.push(("before", format!("number {sequence}, check {crc:08x}")));
    }
    let hash = identity.program_hash;
    lines.push(("program", format!("{}, hash {hash:08x}", version(identity))));
    let key = if identity.needs_key {
        "with the stage's key only"
    } else {
        "by anyone on the bus"
    };
    lines.push(("updated", key.to_owned()));
    let line = |(name, text): (&str, String)| format!("{name:<12} {text}\n");
    lines.into_iter().map(line).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_waits_for_a_reset_and_what_is_not_used_are_told_apart() {
        let kept = |sequence| Some(Kept { sequence, crc: 7 });
        let told = |next, newest_sequence| {
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
            as_text(&Identity {
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
        let has = |text: &str, name| text.lines().any(|line| line.starts_with(name));
        for (next, newest, waits, is_unused) in [
            (kept(3), 3, false, false),
            (kept(4), 4, true, false),
            (kept(3), 4, false, true),
            (kept(4), 5, true, true),
        ] {
            let text = told(next, newest);
            assert_eq!(has(&text, "waiting"), waits, "{text}");
            assert_eq!(has(&text, "refused"), is_unused, "{text}");
            assert!(has(&text, "before"), "{text}");
        }
    }
}
