//! The instructions of an image, as `objdump -d --no-show-raw-insn` lists them.

use std::collections::BTreeMap;

/// One instruction.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Instruction {
    mnemonic: String,
    operands: String,
}

/// Instructions by address.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Listing(BTreeMap<u32, Instruction>);

impl Listing {
    /// Reads a listing; lines that hold no instruction are passed over.
    pub fn parse(text: &str) -> Self {
        let line = |line: &str| {
            let (address, rest) = line.split_once(":\t")?;
            let address = u32::from_str_radix(address.trim(), 16).ok()?;
            let (mnemonic, operands) = rest.split_once('\t').unwrap_or((rest, ""));
            let operands = operands.split(['@', ';']).next().unwrap_or("").trim();
            Some((
                address,
                Instruction {
                    mnemonic: mnemonic.trim().to_owned(),
                    operands: operands.to_owned(),
                },
            ))
        };
        Self(text.lines().filter_map(line).collect())
    }

    /// The instruction at an address.
    pub fn at(&self, address: u32) -> Option<&Instruction> {
        self.0.get(&address)
    }

    /// The instructions from an address up to another.
    pub fn between(&self, from: u32, to: u32) -> impl Iterator<Item = &Instruction> {
        self.0.range(from..to).map(|(_, instruction)| instruction)
    }
}

impl Instruction {
    /// Whether it divides floating-point numbers.
    pub fn is_division(&self) -> bool {
        self.mnemonic.starts_with("vdiv")
    }

    /// Whether it calls a function, directly or through a register.
    pub fn is_call(&self) -> bool {
        matches!(self.mnemonic.as_str(), "bl" | "blx")
    }

    /// Whether it jumps within a function or out of it, other than to return.
    pub fn is_jump(&self) -> bool {
        let name = self.mnemonic.split('.').next().unwrap_or("");
        let returns = name == "bx" && self.operands == "lr";
        let branch = name.starts_with('b')
            && !name.starts_with("bic")
            && !name.starts_with("bf")
            && !name.starts_with("bkpt");
        (branch && !returns) || matches!(name, "cbz" | "cbnz" | "tbb" | "tbh")
    }

    /// Registers of a list like `{r4, r5, d8-d15}`: words that they hold.
    fn listed_words(&self) -> u64 {
        let Some((_, list)) = self.operands.split_once('{') else {
            return 0;
        };
        let list = list.split('}').next().unwrap_or("");
        let number = |name: &str| name.get(1..).and_then(|digits| digits.parse::<u64>().ok());
        let words = |item: &str| {
            let item = item.trim();
            let each = if item.starts_with('d') { 2 } else { 1 };
            match item.split_once('-') {
                Some((from, to)) => match (number(from), number(to)) {
                    (Some(from), Some(to)) => each * (to + 1).saturating_sub(from),
                    _ => each,
                },
                None => each,
            }
        };
        list.split(',').map(words).sum()
    }

    /// Bytes that it takes from the stack.
    pub fn pushed_bytes(&self) -> u64 {
        let name = self.mnemonic.split('.').next().unwrap_or("");
        let immediate = || {
            let (_, text) = self.operands.rsplit_once('#')?;
            text.trim_end_matches(['!', ']']).parse::<i64>().ok()
        };
        match name {
            "push" | "vpush" => 4 * self.listed_words(),
            "stmdb" if self.operands.starts_with("sp!") => 4 * self.listed_words(),
            "sub" | "subw" if self.operands.starts_with("sp,") => immediate()
                .and_then(|bytes| bytes.try_into().ok())
                .unwrap_or(0),
            "str" | "strd" if self.operands.contains("[sp, #-") && self.operands.ends_with('!') => {
                immediate().map_or(0, i64::unsigned_abs)
            }
            _ => 0,
        }
    }
}
