//! Instructions of an image, and those that an emulator executed.

use std::collections::BTreeMap;
use tests::listing::{Instruction, Listing};
use tests::trace::count;

fn one(text: &str) -> Instruction {
    let listing = Listing::parse(&format!("  1154:\t{text}\n"));
    listing.at(0x1154).expect("an instruction").clone()
}

#[test]
fn stack_is_what_pushes_and_subtractions_take() {
    for (text, bytes) in [
        ("push\t{r4, r5, r6, r7, lr}", 20),
        ("stmdb\tsp!, {r8, r9, sl, fp}", 16),
        ("vpush\t{d8-d15}", 64),
        ("sub\tsp, #44\t@ 0x2c", 44),
        ("str.w\tr2, [sp, #-4]!", 4),
        ("strd\tr3, r2, [sp, #-8]!", 8),
        ("str\tr1, [sp, #8]", 0),
        ("sub.w\tr4, ip, lr", 0),
        ("add\tsp, #4", 0),
    ] {
        assert_eq!(one(text).pushed_bytes(), bytes, "{text}");
    }
}

#[test]
fn jumps_calls_and_divisions_are_distinguished() {
    for (text, jump, call, division) in [
        ("bl\tf88 <f>", true, true, false),
        ("bne.n\t1276 <f+0x2a>", true, false, false),
        ("cbz\tr3, 8d2 <f+0x68>", true, false, false),
        ("bx\tlr", false, false, false),
        ("bic.w\tr5, r4, #2", false, false, false),
        ("bfc\tr6, #11, #21", false, false, false),
        ("vdiv.f32\ts0, s1, s2", false, false, true),
        ("blx\tr3", true, true, false),
    ] {
        let found = one(text);
        assert_eq!(found.is_jump(), jump, "{text}");
        assert_eq!(found.is_call(), call, "{text}");
        assert_eq!(found.is_division(), division, "{text}");
    }
}

/// A caller at 0x10 calls 0x100, which calls 0x200.
const LISTING: &str = "\
     100:\tpush\t{r4, lr}
     102:\tvdiv.f32\ts0, s1, s2
     106:\tbl\t200 <callee>
     10a:\tpop\t{r4, pc}
     200:\tbx\tlr
";

fn log(addresses: &[u32]) -> String {
    let line = |at| format!("Trace 0: 0x7f3c [00800408/{at:08x}/00000110/ff000201] name\n");
    addresses.iter().map(line).collect()
}

#[test]
fn a_call_is_counted_with_its_callees() {
    let run = [0x10, 0x100, 0x102, 0x106, 0x200, 0x10a, 0x14, 0x16];
    let functions = BTreeMap::from([("f".to_owned(), (0x100, 0x10c))]);
    let text = log(&run) + "another line\n" + &log(&[0x10, 0x100, 0x10a, 0x14]);
    let counts = count(text.as_bytes(), &Listing::parse(LISTING), &functions).expect("text");
    let Some(f) = counts.get("f") else {
        panic!("not counted")
    };
    assert_eq!((f.calls, f.fewest, f.most), (2, 2, 5));
    assert_eq!((f.divisions, f.in_callees), (1, 1));
}
