extern crate std;

use super::*;
use crate::store::flash_model::FlashModel;
use crate::store::tests::{SERIAL, blob, update};
use std::boxed::Box;
use std::cell::Cell;
use std::vec::Vec;

type OnModel<'f> = Records<&'f mut FlashModel>;

fn room() -> &'static mut Record {
    Box::leak(Box::new(Record::EMPTY))
}

/// A start, with what it runs.
fn start(flash: &mut FlashModel, is_faulty: bool) -> (OnModel<'_>, Option<Vec<u8>>, u8) {
    start_with(flash, SERIAL.into(), is_faulty)
}

fn start_with(
    flash: &mut FlashModel,
    check: Check,
    is_faulty: bool,
) -> (OnModel<'_>, Option<Vec<u8>>, u8) {
    let (mut records, found) = Records::start(flash, room(), check, is_faulty);
    if let Some(blob) = found.blob {
        assert!(records.load(blob, Box::leak(Box::new(None))).is_some());
    }
    let running = update::Store::running(&records).map(|running| running.blob.to_vec());
    let reason = found.refusal.map_or(0, |refusal| refusal.reason);
    (records, running, reason)
}

/// Stores a change to its end, as the ticks do.
fn store(records: &mut OnModel<'_>, change: Change<'_>) -> Written {
    let sequence = update::Store::newest_sequence(records) + 1;
    (0..1000)
        .map(|_| update::Store::write(records, sequence, change))
        .find(|written| *written != Written::InProgress)
        .expect("it ends")
}

/// A flash whose records hold the blobs 0 to `count` - 1.
fn holding(count: usize) -> FlashModel {
    let mut flash = FlashModel::erased();
    let mut store = Store::start(&mut flash, SERIAL);
    for number in 0..count {
        update(&mut store, &mut flash, &blob(number)).expect("room");
    }
    flash
}

/// One sector is full of records with the blobs 0 to count - 1; the other holds neither records nor a
/// blob, and its first word is stuck.
fn full_and_worn() -> (FlashModel, usize) {
    let mut flash = FlashModel::erased();
    let mut store = Store::start(&mut flash, SERIAL);
    flash.load(Sector::Second, &[0; 4]);
    flash.stuck = Some((Sector::Second, 0));
    let written = (0..100).take_while(|number| {
        let blob = blob(*number);
        update(&mut store, &mut flash, &blob).is_ok()
    });
    let count = written.count();
    (flash, count)
}

#[test]
fn what_was_stored_runs_at_the_next_start_and_so_does_what_it_went_back_to() {
    let mut flash = FlashModel::erased();
    let (records, running, reason) = start(&mut flash, false);
    assert_eq!((running, reason), (None, 0));
    assert!(update::Store::previous(&records).is_none());
    for number in 0..3 {
        let (mut records, ..) = start(&mut flash, false);
        let new = blob(number);
        assert_eq!(store(&mut records, Change::Blob(&new)), Written::Done);
        assert_eq!(update::Store::newest_sequence(&records), number as u32 + 1);
        assert_eq!(update::Store::previous(&records).is_some(), number > 0);
        assert_eq!(start(&mut flash, false).1, Some(new));
    }
    let (mut records, ..) = start(&mut flash, false);
    assert_eq!(store(&mut records, Change::Previous), Written::Done);
    let (records, running, reason) = start(&mut flash, false);
    assert_eq!((running, reason), (Some(blob(1)), 0));
    let told = update::Store::running(&records).expect("runs");
    assert_eq!((told.sequence, told.serial), (4, "HS-0007"));
}

#[test]
fn a_change_for_another_number_or_with_an_unsound_blob_stores_nothing() {
    let mut flash = holding(2);
    let before = flash.clone();
    let (mut records, ..) = start(&mut flash, false);
    for (sequence, change) in [
        (2, Change::Blob(&blob(2)[..])),
        (4, Change::Previous),
        (3, Change::Blob(&blob(2)[1..])),
    ] {
        let written = update::Store::write(&mut records, sequence, change);
        assert_eq!(written, Written::Failed);
    }
    assert_eq!(flash, before);
}

#[test]
fn a_faulty_blob_is_passed_over_for_good() {
    let mut flash = holding(3);
    for (is_faulty, has_previous) in [(true, true), (false, true)] {
        let (records, running, reason) = start(&mut flash, is_faulty);
        assert_eq!((running, reason), (Some(blob(1)), 12));
        assert_eq!(update::Store::newest_sequence(&records), 4);
        assert_eq!(update::Store::previous(&records).is_some(), has_previous);
    }
}

#[test]
fn where_there_is_no_other_nothing_runs_until_the_next_start_tries_again() {
    let mut flash = holding(1);
    let before = flash.clone();
    let (mut records, running, reason) = start(&mut flash, true);
    assert_eq!((running, reason), (None, 12));
    // New ones can be stored, and what faulted is one to go back to.
    assert_eq!(store(&mut records, Change::Blob(&blob(1))), Written::Done);
    assert_eq!(start(&mut flash, false).1, Some(blob(1)));
    flash = before;
    assert_eq!(start(&mut flash, true).1, None);
    let (_, running, reason) = start(&mut flash, false);
    assert_eq!((running, reason), (Some(blob(0)), 0));
    assert_eq!(start(&mut FlashModel::erased(), true).2, 0);
}

#[test]
fn of_two_plain_blobs_the_older_runs_if_the_newer_faults_before_it_has_run() {
    for proven in [false, true] {
        let mut flash = FlashModel::erased();
        flash.load(Sector::First, &blob(1));
        flash.load(Sector::Second, &blob(2));
        let (mut records, running, _) = start(&mut flash, false);
        assert_eq!(running, Some(blob(2)));
        assert!(update::Store::is_writable(&records));
        assert!(!update::Store::has_room(&records));
        if proven {
            records.prove();
            let (records, running, _) = start(&mut flash, false);
            assert_eq!(running, Some(blob(2)));
            assert!(update::Store::has_room(&records));
            continue;
        }
        // Without room to write it, after every start.
        let before = flash.clone();
        for _ in 0..2 {
            let (mut records, running, reason) = start(&mut flash, true);
            assert_eq!((running, reason), (Some(blob(1)), 12));
            assert!(!update::Store::has_room(&records));
            records.prove();
            assert_eq!(start(&mut flash, false).1, Some(blob(2)));
        }
        assert_eq!(flash, before);
    }
}

#[test]
fn a_blob_that_was_passed_over_does_not_come_back_in_place_of_another() {
    let mut flash = holding(2);
    assert_eq!(start(&mut flash, true).1, Some(blob(0)));
    let mut check = Check::from(SERIAL);
    check.suspect = crc(0);
    let (_, running, reason) = start_with(&mut flash, check, false);
    assert_eq!((running, reason), (None, 12));
}

#[test]
fn after_one_was_passed_over_a_fault_of_the_next_changes_nothing() {
    let mut flash = holding(3);
    assert_eq!(start(&mut flash, true).1, Some(blob(1)));
    let before = flash.clone();
    let (records, running, reason) = start(&mut flash, true);
    assert_eq!((running, reason), (None, 12));
    assert!(update::Store::is_writable(&records));
    assert_eq!(start(&mut flash, false).1, Some(blob(1)));
    assert_eq!(flash, before);
}

#[test]
fn a_sector_that_the_start_has_renewed_is_not_told_as_damaged() {
    let mut flash = FlashModel::erased();
    flash.load(Sector::First, &blob(0));
    flash.load(Sector::Second, &[0x5a; 4096]);
    for _ in 0..2 {
        let (_, running, reason) = start(&mut flash, false);
        assert_eq!((running, reason), (Some(blob(0)), 0));
    }
}

#[test]
fn without_room_to_pass_it_over_the_blob_before_runs_all_the_same() {
    let (mut flash, count) = full_and_worn();
    let (records, running, reason) = start(&mut flash, false);
    assert_eq!((running, reason), (Some(blob(count - 1)), 13));
    assert!(!update::Store::is_writable(&records));
    let (records, running, reason) = start(&mut flash, true);
    assert_eq!((running, reason), (Some(blob(count - 2)), 12));
    assert!(!update::Store::is_writable(&records));
}

#[test]
fn a_fault_of_the_flash_while_it_is_passed_over_lets_the_blob_before_run() {
    let mut sound = holding(2);
    start(&mut sound, true);
    let words: Vec<_> = sound.bytes(Sector::First).as_chunks::<4>().0.to_vec();
    let last = words.iter().rposition(|word| word == b"SEAL");
    let mut failed = 0;
    for word in last.expect("sealed") - 120..last.expect("sealed") {
        let mut flash = holding(2);
        flash.stuck = Some((Sector::First, word));
        let (records, running, reason) = start(&mut flash, true);
        assert_eq!((running, reason), (Some(blob(0)), 12), "{word}");
        failed += usize::from(!update::Store::is_writable(&records));
    }
    assert!(failed > 80, "{failed}");
}

#[test]
fn a_write_that_fails_is_told_and_the_next_start_can_write() {
    let mut flash = holding(2);
    let old = flash.clone();
    let (mut records, ..) = start(&mut flash, false);
    assert_eq!(store(&mut records, Change::Blob(&blob(2))), Written::Done);
    let changed = |(a, b): (&u8, &u8)| a != b;
    let bytes = [&old, &flash].map(|flash| flash.bytes(Sector::First));
    let first = bytes[0].iter().zip(bytes[1]).position(changed);
    flash = old;
    flash.stuck = Some((Sector::First, first.expect("written") / 4 + 30));
    let (mut records, ..) = start(&mut flash, false);
    assert_eq!(store(&mut records, Change::Blob(&blob(2))), Written::Failed);
    assert!(!update::Store::is_writable(&records));
    assert_eq!(store(&mut records, Change::Blob(&blob(2))), Written::Failed);
    let (mut records, running, reason) = start(&mut flash, false);
    assert_eq!((running, reason), (Some(blob(1)), 0));
    assert_eq!(store(&mut records, Change::Blob(&blob(2))), Written::Done);
    assert_eq!(start(&mut flash, false).1, Some(blob(2)));
}

std::thread_local! {
    /// Must not be read.
    static FAULTY: Cell<Option<u32>> = const { Cell::new(None) };
}

fn crc(number: usize) -> Option<u32> {
    slots::load(&blob(number)).map(|loaded| loaded.crc)
}

#[test]
fn a_blob_whose_check_faults_is_passed_over_and_never_read_again() {
    let mut plain = FlashModel::erased();
    plain.load(Sector::Second, &blob(0));
    let mut records = Store::start(&mut plain, SERIAL);
    for number in [2, 1, 2] {
        update(&mut records, &mut plain, &blob(number)).expect("room");
    }
    let mut check = Check::from(SERIAL);
    check.note = |crc| assert!(crc.is_none() || crc != FAULTY.get());
    for flash in [plain, holding(3)] {
        for (faulty, runs) in [(2, 1), (0, 2), (1, 2)] {
            let mut flash = flash.clone();
            FAULTY.set(crc(faulty));
            for suspect in [crc(faulty), None] {
                check.suspect = suspect;
                let (_, running, reason) = start_with(&mut flash, check, false);
                assert_eq!((running, reason), (Some(blob(runs)), 12), "{faulty}");
            }
            // Given anew, it is one as any other.
            FAULTY.set(None);
            let (mut records, ..) = start(&mut flash, false);
            let again = blob(faulty);
            assert_eq!(store(&mut records, Change::Blob(&again)), Written::Done);
            let (mut records, running, _) = start(&mut flash, false);
            assert_eq!(running.as_ref(), Some(&again));
            assert_eq!(store(&mut records, Change::Blob(&blob(3))), Written::Done);
            let (mut records, ..) = start(&mut flash, false);
            assert_eq!(store(&mut records, Change::Previous), Written::Done);
            assert_eq!(start(&mut flash, false).1, Some(again));
        }
    }
}
