//! What the store promises without cuts of the power.

extern crate std;

use super::flash_model::{Cut, FlashModel};
use super::record::units;
use super::*;
use runtime::ParameterSet;
use runtime::blob::MAX_BYTES;
use runtime::parameters::Text;
use std::vec::Vec;
use std::{format, println};

pub(crate) const SERIAL: Option<&str> = Some("HS-0007");

/// A blob of the stage, in turn of both layouts and of another length.
pub(crate) fn blob(number: usize) -> Vec<u8> {
    let sample: &[u8] = if number % 3 == 2 {
        include_bytes!("../../../examples/field.bin")
    } else {
        include_bytes!("../../../examples/stage.bin")
    };
    let mut set = ParameterSet::from_bytes(sample).expect("the example");
    set.created = Text::try_from(format!("{number}").as_str()).expect("short");
    let mut buffer = [0; MAX_BYTES];
    set.to_bytes(&mut buffer).expect("it fits").to_vec()
}

/// A record with this blob, as due.
pub(super) fn record(store: &Store, blob: &[u8]) -> Result<Record, Refused> {
    let mut record = Record::EMPTY;
    record.room()[..blob.len()].copy_from_slice(blob);
    store.update(&mut record, blob.len(), store.due().expect("not all"))?;
    Ok(record)
}

/// Writes a record to its end.
pub(super) fn write(
    store: &mut Store,
    flash: &mut FlashModel,
    record: &Record,
) -> Result<(), Refused> {
    let mut writing = store.begin(flash, record)?;
    for _ in 0..writing.words() {
        if writing
            .step(flash, record)
            .map_err(|_| Refused::Unsettled)?
            == Step::Done
        {
            store.finish(flash, &writing);
            return Ok(());
        }
    }
    panic!("more steps than words")
}

pub(crate) fn update(
    store: &mut Store,
    flash: &mut FlashModel,
    blob: &[u8],
) -> Result<(), Refused> {
    let record = record(store, blob)?;
    write(store, flash, &record)
}

/// The blob that a start finds.
pub(super) fn found(store: &Store, flash: &FlashModel) -> Option<Vec<u8>> {
    store.newest().map(|stored| stored.blob(flash).to_vec())
}

#[test]
fn what_was_written_is_found_at_the_next_start_and_the_one_before_too() {
    let mut flash = FlashModel::erased();
    let mut store = Store::start(&mut flash, SERIAL);
    assert_eq!((store.newest(), store.due()), (None, Some(1)));
    for number in 0..100 {
        if update(&mut store, &mut flash, &blob(number)) == Err(Refused::NoRoom) {
            store = Store::start(&mut flash, SERIAL);
            assert_eq!(update(&mut store, &mut flash, &blob(number)), Ok(()));
        }
        let again = Store::start(&mut flash, SERIAL);
        for store in [&store, &again] {
            assert_eq!(found(store, &flash), Some(blob(number)));
            let previous = store.previous().map(|stored| stored.blob(&flash).to_vec());
            assert_eq!(previous, number.checked_sub(1).map(blob));
            assert_eq!(store.due(), Some(number as u32 + 2));
        }
    }
}

#[test]
fn updates_of_one_erase_are_as_many_as_documented() {
    let updates = |bytes| (journal::SECTOR_UNITS - 1) / units(bytes);
    assert_eq!([379, 407, 587, MAX_BYTES].map(updates), [36, 31, 23, 21]);
}

#[test]
fn ten_thousand_updates_erase_as_often_as_sectors_are_filled() {
    let erases = |number: fn(usize) -> usize| {
        let mut flash = FlashModel::erased();
        let mut store = Store::start(&mut flash, SERIAL);
        for update_number in 0..10_000 {
            let blob = blob(number(update_number));
            if update(&mut store, &mut flash, &blob) == Err(Refused::NoRoom) {
                store = Store::start(&mut flash, SERIAL);
                assert_eq!(update(&mut store, &mut flash, &blob), Ok(()));
            }
        }
        println!("RESULT updates=10000 erases={:?}", flash.erases);
        flash.erases
    };
    // Model (31) alone: 31 updates an erase; the field model alone: 25.
    assert_eq!(erases(|number| number - number % 3), [162, 161]);
    assert_eq!(erases(|number| number - number % 3 + 2), [200, 200]);
}

#[test]
fn only_the_sequence_number_that_is_due_is_written() {
    let mut flash = FlashModel::erased();
    let mut store = Store::start(&mut flash, SERIAL);
    let [one, other] = [1, 2].map(|number| record(&store, &blob(number)).expect("due"));
    assert_eq!(write(&mut store, &mut flash, &one), Ok(()));
    for late in [&other, &one] {
        let refused = Err(Refused::Sequence { due: 2 });
        assert_eq!(store.begin(&flash, late).map(|_| ()), refused);
    }
    for sequence in [0, 1, 3, u32::MAX] {
        let mut record = Record::EMPTY;
        let bytes = blob(1).len();
        record.room()[..bytes].copy_from_slice(&blob(1));
        let refused = Err(Refused::Sequence { due: 2 });
        assert_eq!(store.update(&mut record, bytes, sequence), refused);
    }
    assert_eq!(found(&store, &flash), Some(blob(1)));
}

#[test]
fn an_unsound_or_foreign_blob_becomes_no_record() {
    let mut flash = FlashModel::erased();
    let store = Store::start(&mut flash, SERIAL);
    let mut damaged = blob(1);
    damaged[50] ^= 1;
    assert!(matches!(
        record(&store, &damaged),
        Err(Refused::Blob(BlobError::BadCrc { .. }))
    ));
    let foreign = Store::start(&mut flash, Some("HS-0008"));
    let refused = record(&foreign, &blob(1)).map(|_| ());
    assert_eq!(refused, Err(Refused::Blob(BlobError::OtherStage)));
    let short = &blob(1)[..40];
    assert!(matches!(
        record(&store, short),
        Err(Refused::Blob(BlobError::Truncated { .. }))
    ));
}

#[test]
fn a_record_of_another_stage_is_told_and_the_one_before_it_used() {
    let mut flash = FlashModel::erased();
    let mut store = Store::start(&mut flash, SERIAL);
    for number in 0..3 {
        assert_eq!(update(&mut store, &mut flash, &blob(number)), Ok(()));
    }
    let other = Store::start(&mut flash, Some("HS-0008"));
    assert_eq!((other.newest(), other.due()), (None, Some(4)));
    let rejected = other.rejected().expect("three");
    assert_eq!(
        (rejected.sequence, rejected.error),
        (3, BlobError::OtherStage)
    );
}

#[test]
fn plain_blobs_are_read_as_the_slots_were_and_are_older_than_any_record() {
    for (created, chosen) in [([1, 2], 1), ([2, 1], 0), ([1, 1], 0)] {
        let mut flash = FlashModel::erased();
        for (sector, number) in Sector::ALL.into_iter().zip(created) {
            flash.load(sector, &blob(number));
        }
        let store = Store::read(&flash, SERIAL);
        let newest = store.newest().expect("two");
        assert_eq!((newest.sequence, newest.sector), (0, Sector::ALL[chosen]));
        assert_eq!(found(&store, &flash), Some(blob(created[chosen])));
        let previous = store.previous().map(|stored| stored.sector);
        assert_eq!(
            previous,
            Some(Sector::ALL[1 - chosen]).filter(|_| created[0] != created[1])
        );
        // The other one is erased, if it is the same or once this one has run, and what is written
        // there counts, though made earlier.
        let before = flash.clone();
        for _ in 0..3 {
            let mut store = Store::start(&mut flash, SERIAL);
            if created[0] != created[1] {
                assert_eq!(flash, before);
                let refused = update(&mut store, &mut flash, &blob(0));
                assert_eq!(refused, Err(Refused::NoRoom));
            }
        }
        Store::start(&mut flash, SERIAL).prove(&mut flash);
        let mut store = Store::start(&mut flash, SERIAL);
        assert_eq!(flash.erases.iter().sum::<usize>(), 1);
        assert_eq!(update(&mut store, &mut flash, &blob(0)), Ok(()));
        let store = Store::start(&mut flash, SERIAL);
        assert_eq!(found(&store, &flash), Some(blob(0)));
        let previous = store.previous().map(|stored| stored.blob(&flash).to_vec());
        assert_eq!(previous, Some(blob(created[chosen])));
    }
}

#[test]
fn the_blob_before_is_not_erased_until_the_newest_has_run() {
    let mut flash = FlashModel::erased();
    flash.load(Sector::First, &blob(0));
    let mut store = Store::start(&mut flash, SERIAL);
    let written = (0..100).take_while(|_| update(&mut store, &mut flash, &blob(1)).is_ok());
    assert_eq!(written.count(), 36);
    for stuck in [None, Some((Sector::Second, 2))] {
        let mut flash = flash.clone();
        flash.stuck = stuck;
        let before = flash.clone();
        for _ in 0..3 {
            let mut store = Store::start(&mut flash, SERIAL);
            let previous = store.previous().map(|stored| stored.blob(&flash).to_vec());
            assert_eq!(previous, Some(blob(0)));
            let refused = update(&mut store, &mut flash, &blob(2));
            assert_eq!((refused, store.fault()), (Err(Refused::NoRoom), None));
        }
        assert_eq!(flash, before);
        flash.cut_at(0, Cut::Inside);
        Store::start(&mut flash, SERIAL).prove(&mut flash);
        for _ in 0..2 {
            flash.power_on();
            Store::start(&mut flash, SERIAL).prove(&mut flash);
        }
        let mut store = Store::start(&mut flash, SERIAL);
        assert_eq!((found(&store, &flash), flash.erases[0]), (Some(blob(1)), 1));
        assert_eq!(update(&mut store, &mut flash, &blob(2)), Ok(()));
        // Where there is room, nothing is written.
        let before = flash.clone();
        Store::start(&mut flash, SERIAL).prove(&mut flash);
        assert_eq!(flash, before);
    }
}

#[test]
fn going_back_can_be_undone_and_what_was_passed_over_never_comes_back() {
    let mut flash = FlashModel::erased();
    let mut store = Store::start(&mut flash, SERIAL);
    for number in 0..4 {
        assert_eq!(update(&mut store, &mut flash, &blob(number)), Ok(()));
    }
    let mut record = Record::EMPTY;
    for expected in [2, 3, 2, 3] {
        assert_eq!(store.go_back(&flash, &mut record), Ok(()));
        assert_eq!(write(&mut store, &mut flash, &record), Ok(()));
        assert_eq!(found(&store, &flash), Some(blob(expected)));
        store = Store::start(&mut flash, SERIAL);
        assert_eq!(found(&store, &flash), Some(blob(expected)));
    }
    // 4, 6 and 8 hold blob 3; passing it over falls back to 7 with blob 2. 2 holds blob 1.
    assert_eq!(
        store.pass_over(&flash, &mut record),
        Err(Refused::NoPrevious)
    );
    let mut check = Check::from(SERIAL);
    check.suspect = stored_crc(&blob(3));
    let mut store = Store::start(&mut flash, check);
    assert_eq!(store.pass_over(&flash, &mut record), Ok(()));
    assert_eq!(write(&mut store, &mut flash, &record), Ok(()));
    let store = Store::start(&mut flash, SERIAL);
    assert_eq!(
        (found(&store, &flash), store.passed_over()),
        (Some(blob(2)), stored_crc(&blob(3)))
    );
    assert_eq!(store.previous().map(|stored| stored.sequence), Some(2));
}

#[test]
fn any_number_of_equal_records_leaves_the_blob_before_in_reach() {
    let mut flash = FlashModel::erased();
    let mut store = Store::start(&mut flash, SERIAL);
    assert_eq!(update(&mut store, &mut flash, &blob(0)), Ok(()));
    for _ in 0..28 {
        assert_eq!(update(&mut store, &mut flash, &blob(1)), Ok(()));
        let again = Store::start(&mut flash, SERIAL);
        for store in [&store, &again] {
            let previous = store.previous().map(|stored| stored.blob(&flash).to_vec());
            assert_eq!(previous, Some(blob(0)));
        }
    }
}
