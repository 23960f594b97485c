//! Executed instructions, counted from an emulator's log.
//!
//! QEMU with one instruction to a translation block (`-singlestep`, from version 8.1
//! `-accel tcg,one-insn-per-tb=on`) and `-d exec,nochain` logs every executed instruction
//! with its address. A call is counted from the first instruction of a function to its
//! return, callees included: until the address after the calling instruction comes up.

use crate::listing::{Instruction, Listing};
use std::collections::BTreeMap;
use std::io::BufRead;

/// The cost of the calls of one function.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Calls.
    pub calls: usize,
    /// Fewest instructions of a call.
    pub fewest: u64,
    /// Most instructions of a call.
    pub most: u64,
    /// Most divisions of a call.
    pub divisions: u64,
    /// Instructions of the function's callees, over all calls.
    pub in_callees: u64,
}

/// A call in progress.
struct Call {
    entry: u32,
    end: u32,
    return_to: [u32; 2],
    instructions: u64,
    divisions: u64,
    in_callees: u64,
}

/// The address of a log line, or `None` for any other line.
///
/// `Trace 0: 0x7f00 [00800408/0000114e/00000110/ff000201] name`: the second of the four.
pub fn address(line: &str) -> Option<u32> {
    let inside = line.strip_prefix("Trace ")?.split_once('[')?.1;
    u32::from_str_radix(inside.split('/').nth(1)?, 16).ok()
}

/// Counts every call of the functions in `functions`, name to first and last address.
pub fn count(
    log: impl BufRead,
    listing: &Listing,
    functions: &BTreeMap<String, (u32, u32)>,
) -> std::io::Result<BTreeMap<String, Counts>> {
    let by_entry: BTreeMap<u32, (&String, u32)> = functions
        .iter()
        .map(|(name, &(entry, end))| (entry, (name, end)))
        .collect();
    let mut counts: BTreeMap<String, Counts> = BTreeMap::new();
    let mut call: Option<Call> = None;
    let mut before = 0;
    for line in log.lines() {
        let Some(at) = address(&line?) else { continue };
        if let Some(done) = call.take_if(|call| call.return_to.contains(&at))
            && let Some((name, _)) = by_entry.get(&done.entry)
        {
            counts.entry((*name).clone()).or_default().add(&done);
        }
        if let (None, Some(&(_, end))) = (&call, by_entry.get(&at)) {
            call = Some(Call {
                entry: at,
                end,
                // A calling instruction is four bytes long, or two.
                return_to: [before + 4, before + 2],
                instructions: 0,
                divisions: 0,
                in_callees: 0,
            });
        }
        if let Some(call) = &mut call {
            let instruction = listing.at(at);
            call.instructions += 1;
            call.divisions += u64::from(instruction.is_some_and(Instruction::is_division));
            call.in_callees += u64::from(!(call.entry..call.end).contains(&at));
        }
        before = at;
    }
    Ok(counts)
}

impl Counts {
    fn add(&mut self, call: &Call) {
        self.fewest = match self.calls {
            0 => call.instructions,
            _ => self.fewest.min(call.instructions),
        };
        self.calls += 1;
        self.most = self.most.max(call.instructions);
        self.divisions = self.divisions.max(call.divisions);
        self.in_callees += call.in_callees;
    }
}
