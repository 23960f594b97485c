//! Counts executed instructions from an emulator's log and holds them to their limits.
//! See `count --help`.

use clap::Parser;
use object::{Object, ObjectSymbol};
use std::collections::BTreeMap;
use std::error::Error;
use std::fs::File;
use std::io::BufReader;
use std::path::PathBuf;
use std::process::ExitCode;
use tests::listing::Listing;
use tests::trace::{Counts, count};

/// Counts the executed instructions of every function `counted_*` of an image, prints
/// `RESULT key=value` lines and fails where a limit is broken.
#[derive(Parser)]
struct Cli {
    /// The image that ran.
    image: PathBuf,
    /// Its listing, by `objdump -d --no-show-raw-insn`.
    listing: PathBuf,
    /// The emulator's log; a pipe will do.
    log: PathBuf,
    /// Put before every key.
    #[arg(long, default_value = "")]
    prefix: String,
}

/// Limits of one function: instructions, stack in bytes, divisions. The tick of the field model
/// saves 104 bytes of registers on the stack.
const LIMITS: [(&str, u64, u64, u64); 5] = [
    ("kernel", 77, 96, 3),
    ("tick", 280, 96, 3),
    ("field_kernel", 370, 112, 3),
    ("field_tick", 520, 120, 3),
    ("motion", 60, 16, 0),
];

/// Functions that together make one job, and the most instructions that it may take: the two
/// bus frames of a tick coded, and checked and put together again.
const JOBS: [(&str, &[&str], u64); 1] = [("can_tick", &["can_code", "can_check"], 402)];

/// Instructions of the loop that checks the counting: 1 + 1000 * 3 + 2.
const LOOP: (&str, u64) = ("loop_1000", 3003);

fn main() -> ExitCode {
    tests::exit("count", run(&Cli::parse()))
}

fn run(cli: &Cli) -> Result<bool, Box<dyn Error>> {
    let image = std::fs::read(&cli.image)?;
    let elf = object::File::parse(&*image)?;
    let mut functions = BTreeMap::new();
    for symbol in elf.symbols() {
        if let Some(name) = symbol.name().ok().and_then(|n| n.strip_prefix("counted_")) {
            // The lowest bit of a Thumb function's address is not part of it.
            let entry = u32::try_from(symbol.address() & !1)?;
            let end = entry + u32::try_from(symbol.size())?;
            functions.insert(name.to_owned(), (entry, end));
        }
    }
    let listing = Listing::parse(&std::fs::read_to_string(&cli.listing)?);
    let log = BufReader::with_capacity(1 << 20, File::open(&cli.log)?);
    let counts = count(log, &listing, &functions)?;
    let mut broken = Vec::new();
    for (name, &(entry, end)) in &functions {
        let c = counts.get(name).copied().unwrap_or_default();
        let stack: u64 = listing.between(entry, end).map(|i| i.pushed_bytes()).sum();
        let calls_out = listing.between(entry, end).filter(|i| i.is_call()).count();
        let jumps = listing.between(entry, end).filter(|i| i.is_jump()).count();
        let key = format!("{}{name}", cli.prefix);
        println!("RESULT {key}_calls={}", c.calls);
        println!("RESULT {key}_instructions={}", c.most);
        println!("RESULT {key}_spread={}", c.most - c.fewest);
        println!("RESULT {key}_divisions={}", c.divisions);
        println!("RESULT {key}_stack_bytes={stack}");
        println!("RESULT {key}_text_bytes={}", end - entry);
        println!("RESULT {key}_jumps={jumps}");
        broken.extend(check(name, &key, c, stack, calls_out + jumps));
    }
    for (job, parts, most) in JOBS {
        let part = |name: &&str| counts.get(*name).map_or(u64::MAX, |c| c.most);
        let found = parts.iter().map(part).fold(0, u64::saturating_add);
        println!("RESULT {}{job}_instructions={found}", cli.prefix);
        if found > most {
            broken.push(format!(
                "{job}: {found} instructions, at most {most} are allowed"
            ));
        }
    }
    for name in LIMITS.map(|limit| limit.0).into_iter().chain([LOOP.0]) {
        if !functions.contains_key(name) {
            broken.push(format!("counted_{name}: not in the image"));
        }
    }
    for limit in &broken {
        println!("BROKEN {limit}");
    }
    Ok(broken.is_empty())
}

/// The limits that a function breaks.
fn check(name: &str, key: &str, c: Counts, stack: u64, jumps: usize) -> Vec<String> {
    let mut broken = Vec::new();
    if c.calls == 0 {
        broken.push(format!("{key}: never called"));
    }
    if name == LOOP.0 && (c.most, c.fewest) != (LOOP.1, LOOP.1) {
        broken.push(format!(
            "{key}: a loop of {} instructions counts {}",
            LOOP.1, c.most
        ));
    }
    for (_, instructions, bytes, divisions) in LIMITS.iter().filter(|limit| limit.0 == name) {
        let mut limit = |what: &str, found: u64, most: u64| {
            if found > most {
                broken.push(format!("{key}: {found} {what}, at most {most} are allowed"));
            }
        };
        limit("instructions", c.most, *instructions);
        limit("bytes of stack", stack, *bytes);
        limit("divisions", c.divisions, *divisions);
        limit("instructions more on some inputs", c.most - c.fewest, 0);
        limit("instructions in callees", c.in_callees, 0);
        limit("jumps or calls", jumps as u64, 0);
    }
    broken
}
