//! Flash and static memory of an image. See `flash --help`.

use clap::Parser;
use object::{Object, ObjectSection, ObjectSymbol};
use std::error::Error;
use std::path::PathBuf;
use std::process::ExitCode;

/// Prints the code, constants and static memory of an image, without the vector table; fails
/// where the code breaks a limit, or a panic, a heap or formatting of numbers is in it.
#[derive(Parser)]
struct Cli {
    /// The image.
    image: PathBuf,
    /// Put before every key.
    #[arg(long, default_value = "")]
    prefix: String,
    /// Most bytes of code.
    #[arg(long)]
    limit: Option<u64>,
}

/// Parts of symbol names that no image of the runtime holds: panics, heap, formatting of
/// numbers.
const UNWANTED: [&str; 4] = ["panicking", "__rust_alloc", "__rg_alloc", "core3fmt5float"];

fn main() -> ExitCode {
    tests::exit("flash", run(&Cli::parse()))
}

fn run(cli: &Cli) -> Result<bool, Box<dyn Error>> {
    let bytes = std::fs::read(&cli.image)?;
    let elf = object::File::parse(&*bytes)?;
    let size = |name: &str| {
        elf.section_by_name(name)
            .map_or(0, |section| section.size())
    };
    let (code, constants) = (size(".text"), size(".rodata"));
    println!("RESULT {}_text_bytes={code}", cli.prefix);
    println!("RESULT {}_constant_bytes={constants}", cli.prefix);
    println!(
        "RESULT {}_static_ram_bytes={}",
        cli.prefix,
        size(".data") + size(".bss")
    );
    let mut good = true;
    for symbol in elf.symbols() {
        let name = symbol.name().unwrap_or("");
        if UNWANTED.iter().any(|part| name.contains(part)) {
            println!("UNWANTED {name}");
            good = false;
        }
    }
    if let Some(limit) = cli.limit.filter(|limit| code > *limit) {
        println!("BROKEN {} bytes of code, at most {limit} are allowed", code);
        good = false;
    }
    Ok(good)
}
