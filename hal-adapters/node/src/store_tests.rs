//! Cuts of the power before, inside and after every operation on the flash, and again during the start that follows: a
//! start finds the old blob or the new one. And stuck words and reported errors.

extern crate std;

use super::flash_model::{Cut, FlashModel, Words, slots};
use super::*;
use crate::records::{Choice, Records};
use embedded_storage::nor_flash::NorFlash as _;
use hal_adapters::can::update::Store;
use runtime::ParameterSet;
use runtime::parameters::Text;
use std::vec::Vec;
use std::{format, println};

/// Courses of chance of a cut inside: many where the slot is dropped and erased and where the blob is committed, few
/// between.
const SEEDS: [u64; 2] = [64, 4];
pub(crate) const SERIAL: Option<&str> = Some("HS-0007");

/// A blob of the stage, in turn of both layouts and of another length.
pub(crate) fn blob(number: usize) -> Vec<u8> {
    let sample: &[u8] = if number % 3 == 2 {
        include_bytes!("../../../runtime/examples/field.bin")
    } else {
        include_bytes!("../../../runtime/examples/stage.bin")
    };
    let mut set = ParameterSet::from_bytes(sample).expect("the example");
    set.created = Text::try_from(format!("{number}").as_str()).expect("short");
    let mut buffer = [0; MAX_BYTES];
    set.to_bytes(&mut buffer).expect("it fits").to_vec()
}

pub(crate) fn crc(blob: &[u8]) -> u32 {
    u32::from_le_bytes(*blob.last_chunk().expect("a blob"))
}

/// A start after power-on.
pub(crate) fn start(flash: &mut FlashModel) -> Records<&mut FlashModel> {
    Records::start(slots(flash), Choice::Newest, SERIAL).0
}

/// A flash with these blobs: first the plain blobs of a probe, in slots 0 and 1, then the stored blobs.
fn holding(plain: &[usize], stored: &[usize]) -> FlashModel {
    let mut flash = FlashModel::erased();
    for (slot, number) in (0..).zip(plain) {
        flash.load(slot, &blob(*number));
    }
    for number in stored {
        update(&mut flash, &blob(*number)).expect("it is written");
    }
    flash
}

pub(crate) fn update(flash: &mut FlashModel, blob: &[u8]) -> Result<(), NotWritten> {
    let mut records = start(flash);
    records.write(records.newest_sequence() + 1, blob)
}

/// The CRC of the blob that a start runs.
fn found(flash: &mut FlashModel) -> Option<u32> {
    start(flash).newest().map(|kept| kept.crc)
}

/// A flash before a change, the change, and the blobs that run before and afterwards.
struct Scenario {
    name: &'static str,
    flash: FlashModel,
    found: [Option<u32>; 2],
}

/// A start after a cut: what is found must be one of two, must stay, and must be replaceable. Gives
/// the operations on the flash of this start.
fn verify(mut flash: FlashModel, scenario: &Scenario, confirmed: bool, case: &str) -> usize {
    flash.power_on();
    let first = found(&mut flash);
    let operations = flash.operations;
    let [old, new] = scenario.found;
    assert!(first == new || !confirmed && first == old, "{case}");
    for _ in 0..2 {
        flash.power_on();
        assert_eq!(found(&mut flash), first, "{case}: at another start");
    }
    let last = blob(101);
    assert_eq!(update(&mut flash, &last), Ok(()), "{case}");
    flash.power_on();
    assert_eq!(found(&mut flash), Some(crc(&last)), "{case}: written later");
    operations
}

#[test]
fn after_any_cut_the_old_blob_is_found_or_the_new_one() {
    let of = |number| Some(crc(&blob(number)));
    let new = of(100);
    let scenario = |name, flash, found| Scenario { name, flash, found };
    let mut damaged = holding(&[], &[1, 2]);
    damaged.seed(5);
    damaged.cut_at(80, Cut::Inside);
    assert!(update(&mut damaged, &blob(3)).is_err());
    let mut total = 0;
    for scenario in [
        scenario("empty", FlashModel::erased(), [None, new]),
        scenario("a plain blob", holding(&[1], &[]), [of(1), new]),
        scenario("two plain blobs", holding(&[1, 2], &[]), [of(1), new]),
        scenario("one stored", holding(&[], &[1]), [of(1), new]),
        scenario("two stored", holding(&[], &[1, 2]), [of(2), new]),
        scenario(
            "stored beside a plain one",
            holding(&[1], &[2]),
            [of(2), new],
        ),
        scenario("a torn one", damaged, [of(2), new]),
    ] {
        total += cut_everywhere(&scenario);
    }
    println!("RESULT cuts_of_the_store={total}");
}

fn cut_everywhere(scenario: &Scenario) -> usize {
    let new = blob(100);
    let run = |flash: &mut FlashModel| update(flash, &new).is_ok();
    let mut whole = scenario.flash.clone();
    whole.power_on();
    assert!(run(&mut whole));
    let (operations, mut cuts, mut confirmations) = (whole.operations, 0, 0);
    // The last operation comes after the confirmation: the cut hits the next start.
    for operation in 0..=operations {
        let is_between = (3..operations - 4).contains(&operation);
        for cut in Cut::ALL {
            // Chance plays a part inside only.
            let seeds = if cut == Cut::Inside {
                SEEDS[usize::from(is_between)]
            } else {
                2
            };
            for seed in 0..seeds {
                let mut flash = scenario.flash.clone();
                flash.seed(seed ^ (operation as u64) << 8);
                flash.power_on();
                flash.cut_at(operation, cut);
                let confirmed = run(&mut flash);
                cuts += usize::from(flash.is_off());
                confirmations += usize::from(confirmed);
                let case = format!("{} {operation} {cut:?} {seed}", scenario.name);
                // Again, during the start, wherever it does something.
                for second in 0..verify(flash.clone(), scenario, confirmed, &case) {
                    for again in Cut::ALL {
                        let mut flash = flash.clone();
                        flash.power_on();
                        flash.cut_at(second, again);
                        start(&mut flash);
                        cuts += 1;
                        verify(
                            flash,
                            scenario,
                            confirmed,
                            &format!("{case} {second} {again:?}"),
                        );
                    }
                }
            }
        }
    }
    assert!(confirmations > 0, "{}", scenario.name);
    println!("{}: {operations} operations, {cuts} cuts", scenario.name);
    cuts
}

/// Updates and starts in a long row, each cut or not.
#[test]
fn any_number_of_cuts_in_a_row_loses_nothing() {
    let mut cuts = 0;
    for seed in 0..16 {
        let (mut words, mut flash) = (Words(seed), FlashModel::erased());
        flash.seed(seed);
        let mut there = None;
        for number in 0..250 {
            let new = blob(number);
            flash.power_on();
            let cut = Cut::ALL[words.below(3) as usize];
            match words.below(3) {
                0 => {}
                1 => flash.cut_at(words.below(6) as usize, cut),
                _ => flash.cut_at(words.below(110) as usize, cut),
            }
            let confirmed = update(&mut flash, &new).is_ok();
            cuts += usize::from(flash.is_off());
            flash.power_on();
            let now = found(&mut flash);
            let is_new = now == Some(crc(&new));
            assert!(is_new || !confirmed && now == there, "{seed} {number}");
            there = now;
        }
    }
    println!("RESULT cuts_in_a_row={cuts}");
    assert!(cuts > 2_000);
}

#[test]
fn a_word_that_does_not_hold_costs_no_blob_that_was_there() {
    let sound = holding(&[], &[1, 2]);
    for word in (0..FlashModel::ERASE_SIZE / 4).filter(|word| word % 61 == 0 || *word < USED / 4) {
        let mut flash = sound.clone();
        flash.stuck = Some(word);
        let written = update(&mut flash, &blob(3)).is_ok();
        let expected = blob(if written { 3 } else { 2 });
        assert_eq!(found(&mut flash), Some(crc(&expected)), "{word}");
    }
    for at in 0..100 {
        let mut flash = sound.clone();
        flash.power_on();
        flash.reports = Some(at);
        assert_eq!(update(&mut flash, &blob(3)), Err(NotWritten::Failed));
        flash.power_on();
        flash.reports = None;
        assert_eq!(found(&mut flash), Some(crc(&blob(2))), "{at}");
        assert_eq!(update(&mut flash, &blob(3)), Ok(()));
    }
}

#[test]
fn no_changed_bit_of_a_stored_blob_or_its_number_is_accepted() {
    let image = slots(&mut holding(&[], &[1])).image(0);
    assert_eq!(image.contents(), Contents::Committed(1));
    for bit in 0..8 * SEAL {
        let mut changed = image.clone();
        changed.0[bit / 8] ^= 1 << (bit % 8);
        assert!(!matches!(
            changed.contents(),
            Contents::Committed(_) | Contents::Plain
        ));
    }
}
