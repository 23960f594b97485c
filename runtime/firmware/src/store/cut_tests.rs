//! The power is cut before, inside and after every operation on the flash, and again during the
//! start that follows: the old blob is found or the new one, and nothing else.

extern crate std;

use super::flash_model::{Cut, FlashModel, Words};
use super::tests::{SERIAL, blob, found, update, write};
use super::*;
use std::println;
use std::vec::Vec;

const SEEDS: u64 = 64;

/// What is done between two starts.
#[derive(Clone, Debug)]
enum Action {
    Update(Vec<u8>),
    GoBack,
    PassOver(Vec<u8>),
    Prove,
}

/// A flash before the action, and what its start finds: before and afterwards.
struct Scenario {
    name: &'static str,
    flash: FlashModel,
    action: Action,
    old: Option<Vec<u8>>,
    new: Option<Vec<u8>>,
    /// What is written after everything, to see that it can be.
    last: Vec<u8>,
}

impl Scenario {
    fn new(
        name: &'static str,
        flash: FlashModel,
        action: Action,
        found: [Option<usize>; 2],
    ) -> Self {
        let [old, new] = found.map(|number| number.map(blob));
        let last = blob(101);
        Self {
            name,
            flash,
            action,
            old,
            new,
            last,
        }
    }
}

/// Where the power was cut: in which scenario, operation and phase, by which seed; and where
/// during the start that followed.
type Case = (&'static str, usize, Cut, u64, Option<(usize, Cut)>);

/// A store that holds the blobs 0 to `count` - 1.
fn journal(count: usize) -> FlashModel {
    let mut flash = FlashModel::erased();
    let mut store = Store::start(&mut flash, SERIAL);
    for number in 0..count {
        while update(&mut store, &mut flash, &blob(number)) == Err(Refused::NoRoom) {
            store = Store::start(&mut flash, SERIAL);
        }
    }
    flash
}

/// A store whose next start erases, and how many blobs it holds.
fn full() -> (FlashModel, usize) {
    (20..100)
        .map(|count| (journal(count), count))
        .find(|(flash, _)| {
            let erases = flash.erases;
            let mut flash = flash.clone();
            Store::start(&mut flash, SERIAL);
            flash.erases != erases
        })
        .expect("some count fills a sector")
}

/// A store that an update with blob 100 fills, so that the start after it erases; and how many blobs
/// it holds.
fn nearly_full() -> (FlashModel, usize) {
    (20..100)
        .map(|count| (journal(count), count))
        .find(|(flash, _)| {
            let mut flash = flash.clone();
            let mut store = Store::start(&mut flash, SERIAL);
            let erases = flash.erases;
            update(&mut store, &mut flash, &blob(100)).expect("room");
            Store::start(&mut flash, SERIAL);
            flash.erases != erases
        })
        .expect("some count nearly fills a sector")
}

/// Updates that were cut off at various words, each behind a whole one.
fn torn() -> FlashModel {
    let mut flash = journal(2);
    flash.seed(5);
    for (number, word) in [(50, 0), (51, 1), (52, 3), (53, 60), (54, 102)] {
        let mut store = Store::start(&mut flash, SERIAL);
        flash.cut_at(word, Cut::Inside);
        assert!(update(&mut store, &mut flash, &blob(number)).is_err());
        flash.power_on();
    }
    let mut store = Store::start(&mut flash, SERIAL);
    update(&mut store, &mut flash, &blob(2)).expect("room");
    let mut store = Store::start(&mut flash, SERIAL);
    flash.cut_at(40, Cut::Inside);
    assert!(update(&mut store, &mut flash, &blob(55)).is_err());
    flash.power_on();
    flash
}

fn plain(blobs: &[(Sector, usize)]) -> FlashModel {
    let mut flash = FlashModel::erased();
    for &(sector, number) in blobs {
        flash.load(sector, &blob(number));
    }
    flash
}

/// Starts, does the action, and says whether its end was told.
fn run(flash: &mut FlashModel, action: &Action) -> bool {
    let mut check = Check::from(SERIAL);
    if let Action::PassOver(blob) = action {
        check.suspect = stored_crc(blob);
    }
    let mut store = Store::start(flash, check);
    store.prove(flash);
    let mut record = Record::EMPTY;
    let made = match action {
        Action::Update(blob) => return update(&mut store, flash, blob).is_ok(),
        Action::GoBack => store.go_back(flash, &mut record),
        Action::PassOver(_) => store.pass_over(flash, &mut record),
        Action::Prove => return !flash.is_off(),
    };
    made.and_then(|()| write(&mut store, flash, &record))
        .is_ok()
}

/// Starts after a cut: what is found must be one of two, must stay, and must be replaceable.
/// Gives the operations on the flash of this start.
fn verify(mut flash: FlashModel, scenario: &Scenario, told: bool, case: &Case) -> usize {
    flash.power_on();
    let store = Store::start(&mut flash, SERIAL);
    let operations = flash.operations;
    let first = found(&store, &flash);
    store.prove(&mut flash);
    assert!(
        first == scenario.new || !told && first == scenario.old,
        "{case:?}"
    );
    flash.power_on();
    let mut store = Store::start(&mut flash, SERIAL);
    assert_eq!(store.fault(), None, "{case:?}");
    assert_eq!(found(&store, &flash), first, "{case:?}: at another start");
    let last = &scenario.last;
    assert_eq!(update(&mut store, &mut flash, last), Ok(()), "{case:?}");
    flash.power_on();
    let store = Store::start(&mut flash, SERIAL);
    assert_eq!(
        found(&store, &flash).as_ref(),
        Some(last),
        "{case:?}: written later"
    );
    operations
}

/// Cuts everywhere from operation `first` on; gives how many cuts were tried.
fn cut_from(first: usize, scenario: &Scenario) -> usize {
    let name = scenario.name;
    let mut whole = scenario.flash.clone();
    whole.power_on();
    assert!(run(&mut whole, &scenario.action));
    let operations = whole.operations;
    let (mut cuts, mut told_of) = (0, 0);
    // The last one comes after the end of the action was told: what is cut is the next start.
    for operation in first..=operations {
        for cut in Cut::ALL {
            // Chance plays a part inside only.
            for seed in 0..if cut == Cut::Inside { SEEDS } else { 2 } {
                let mut flash = scenario.flash.clone();
                flash.seed(seed ^ (operation as u64) << 8);
                flash.power_on();
                flash.cut_at(operation, cut);
                let told = run(&mut flash, &scenario.action);
                cuts += usize::from(flash.is_off());
                told_of += usize::from(told);
                let mut case = (name, operation, cut, seed, None);
                // Again, during the start, wherever it does something.
                for second in 0..verify(flash.clone(), scenario, told, &case) {
                    for again in Cut::ALL {
                        let mut flash = flash.clone();
                        flash.power_on();
                        flash.cut_at(second, again);
                        Store::start(&mut flash, SERIAL);
                        cuts += 1;
                        case.4 = Some((second, again));
                        verify(flash, scenario, told, &case);
                    }
                }
            }
        }
    }
    assert!(told_of > 0, "{name}");
    println!("{name}: {operations} operations, {cuts} cuts, {told_of} after the end was told");
    cuts
}

#[test]
fn after_any_cut_of_an_update_the_old_blob_is_found_or_the_new_one() {
    let (full, count) = full();
    let (nearly_full, nearly) = nearly_full();
    let mut plain_2 = plain(&[(Sector::First, 1), (Sector::Second, 2)]);
    Store::start(&mut plain_2, SERIAL).prove(&mut plain_2);
    let states = [
        ("empty store", FlashModel::erased(), None),
        ("a plain blob", plain(&[(Sector::Second, 1)]), Some(1)),
        ("two plain blobs", plain_2, Some(2)),
        ("half-full journal", journal(12), Some(11)),
        ("journal that needs an erase", full, Some(count - 1)),
        ("journal with torn records", torn(), Some(2)),
    ];
    let mut cuts = 0;
    for (name, flash, old) in states {
        let action = Action::Update(blob(100));
        cuts += cut_from(0, &Scenario::new(name, flash, action, [old, Some(100)]));
    }
    // Here every start after it erases, so the last words before it must do.
    let (name, action) = ("journal that is full after it", Action::Update(blob(100)));
    let found = [Some(nearly - 1), Some(100)];
    cuts += cut_from(100, &Scenario::new(name, nearly_full, action, found));
    println!("RESULT cuts_of_updates={cuts}");
    assert_eq!(cuts, 74_701);
}

#[test]
fn going_back_and_passing_over_survive_any_cut() {
    let mut cuts = 0;
    for (name, action) in [
        ("going back", Action::GoBack),
        ("passing over", Action::PassOver(blob(2))),
    ] {
        let found = [Some(2), Some(1)];
        let flash = journal(3);
        cuts += cut_from(0, &Scenario::new(name, flash, action, found));
    }
    println!("RESULT cuts_of_going_back={cuts}");
    assert_eq!(cuts, 16_417);
}

/// Of two plain blobs, and of a journal that one and the same blob fills: the erase of the blob before
/// waits until the newest has run.
#[test]
fn proving_the_newest_blob_survives_any_cut() {
    let mut journal = plain(&[(Sector::First, 0)]);
    let mut store = Store::start(&mut journal, SERIAL);
    while update(&mut store, &mut journal, &blob(1)).is_ok() {}
    let two = plain(&[(Sector::First, 0), (Sector::Second, 1)]);
    let mut cuts = 0;
    for (name, flash) in [("two plain blobs that run", two), ("one blob", journal)] {
        let found = [Some(1), Some(1)];
        cuts += cut_from(0, &Scenario::new(name, flash, Action::Prove, found));
    }
    println!("RESULT cuts_of_proving={cuts}");
    assert_eq!(cuts, 2_104);
}

/// Updates, going back and starts in a long row, each cut or not.
#[test]
fn any_number_of_cuts_in_a_row_loses_nothing() {
    let mut cuts = 0;
    let mut erases = 0;
    for seed in 0..16 {
        let mut words = Words(seed);
        let mut flash = FlashModel::erased();
        flash.seed(seed);
        let mut there = None;
        for number in 0..250 {
            let new = blob(number);
            let cut = Cut::ALL[words.below(3) as usize];
            flash.power_on();
            // Some starts are cut, most updates, and one in three is left alone.
            match words.below(3) {
                0 => {}
                1 => flash.cut_at(words.below(6) as usize, cut),
                _ => flash.cut_at(words.below(110) as usize, cut),
            }
            let told = run(&mut flash, &Action::Update(new.clone()));
            cuts += usize::from(flash.is_off());
            flash.power_on();
            let store = Store::start(&mut flash, SERIAL);
            let now = found(&store, &flash);
            assert!(
                now.as_ref() == Some(&new) || !told && now == there,
                "{seed} {number}"
            );
            there = now;
        }
        erases += flash.erases[0] + flash.erases[1];
    }
    println!("RESULT cuts_in_a_row={cuts} erases={erases}");
    assert_eq!((cuts, erases), (2_639, 192));
}
