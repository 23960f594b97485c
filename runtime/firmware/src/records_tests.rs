extern crate std;

use super::*;
use crate::store::flash_model::FlashModel;
use crate::store::tests::{SERIAL, blob, crc, start, update};
use std::boxed::Box;
use std::vec::Vec;

fn runs(flash: &mut FlashModel, choice: Choice) -> Option<u32> {
    let (mut records, _) = Records::start(flash, choice, SERIAL);
    let place = Box::leak(Box::new(MaybeUninit::uninit()));
    records.load(choice, place).map(|loaded| loaded.crc)
}

#[test]
fn a_reset_runs_what_ran_and_what_is_stored_waits_for_an_activation() {
    let mut flash = FlashModel::erased();
    for number in [1, 2] {
        assert_eq!(update(&mut flash, &blob(number)), Ok(()));
    }
    let [old, new] = [1, 2].map(|number| crc(&blob(number)));
    assert_eq!(runs(&mut flash, Choice::Blob(old)), Some(old));
    assert_eq!(runs(&mut flash, Choice::Blob(new)), Some(new));
    assert_eq!(runs(&mut flash, Choice::Newest), Some(new));
    assert_eq!(runs(&mut flash, Choice::Nothing), None);
    assert_eq!(runs(&mut flash, Choice::Blob(1)), None);
    // Another two: what ran is no longer there, and nothing else runs for it.
    for number in [3, 4] {
        assert_eq!(update(&mut flash, &blob(number)), Ok(()));
    }
    assert_eq!(runs(&mut flash, Choice::Blob(old)), None);
}

#[test]
fn each_kind_of_unusable_blob_is_reported_and_the_other_one_runs() {
    let sound = blob(1);
    let mut torn = sound.clone();
    torn[200..].fill(0xff);
    let mut foreign = sound.clone();
    foreign[0] = b'X';
    for (slots, newest, reason) in [
        ([&[][..], &[]], None, None),
        ([&sound, &[]], Some(&sound), None),
        ([&[], &sound], Some(&sound), None),
        ([&torn, &sound], Some(&sound), Some(0x07)),
        ([&sound, &torn], Some(&sound), Some(0x17)),
        ([&foreign, &[]], None, Some(0x03)),
        ([&torn, &foreign], None, Some(0x07)),
    ] {
        let mut flash = FlashModel::erased();
        (0..)
            .zip(slots)
            .for_each(|(slot, contents)| flash.load(slot, contents));
        let (records, refusal) = Records::start(&mut flash, Choice::Newest, SERIAL);
        assert_eq!(refusal.map(|refusal| refusal.reason), reason);
        assert_eq!(
            records.newest().map(|kept| kept.crc),
            newest.map(|blob| crc(blob))
        );
    }
    // Of two that a probe has flashed that in slot 0; a stored one is newer.
    let mut flash = FlashModel::erased();
    flash.load(0, &blob(1));
    flash.load(1, &blob(2));
    assert_eq!(runs(&mut flash, Choice::Newest), Some(crc(&blob(1))));
    assert_eq!(update(&mut flash, &blob(3)), Ok(()));
    assert_eq!(runs(&mut flash, Choice::Newest), Some(crc(&blob(3))));
    let (other, refusal) = Records::start(&mut flash, Choice::Newest, Some("HS-0008"));
    assert_eq!((other.newest(), other.newest_sequence()), (None, 1));
    assert_eq!(refusal, Some(Refusal { reason: 10 }));
}

#[test]
fn going_back_can_be_undone() {
    let mut flash = FlashModel::erased();
    for number in [1, 2] {
        assert_eq!(update(&mut flash, &blob(number)), Ok(()));
    }
    for (sequence, expected) in [(3, 1), (4, 2), (5, 1)] {
        let mut records = start(&mut flash);
        let previous = records.previous().map(|kept| kept.crc);
        assert_eq!(previous, Some(crc(&blob(expected))));
        assert_eq!(records.write(sequence, Change::Previous), Ok(()));
        let newest = records.newest().expect("written");
        assert_eq!(
            (newest.sequence, newest.crc),
            (sequence, crc(&blob(expected)))
        );
        assert_eq!(start(&mut flash).newest(), Some(newest));
    }
}

#[test]
fn the_blob_that_runs_is_read_word_by_word() {
    let mut flash = FlashModel::erased();
    assert_eq!(update(&mut flash, &blob(2)), Ok(()));
    let (mut records, _) = Records::start(&mut flash, Choice::Newest, SERIAL);
    assert_eq!(records.word(0), None);
    records.load(Choice::Newest, Box::leak(Box::new(MaybeUninit::uninit())));
    let words = (0..).map_while(|index| records.word(index));
    let bytes: Vec<u8> = words.flat_map(u32::to_le_bytes).collect();
    assert!(bytes.starts_with(&blob(2)) && bytes.len() < blob(2).len() + 4);
}

#[test]
fn what_runs_stays_however_much_is_stored_before_an_activation() {
    let mut flash = FlashModel::erased();
    for number in [1, 2] {
        assert_eq!(update(&mut flash, &blob(number)), Ok(()));
    }
    let ran = crc(&blob(1));
    for (sequence, change) in [
        (3, Change::Blob(&blob(3))),
        (4, Change::Blob(&blob(4))),
        (5, Change::Previous),
        (6, Change::Blob(&blob(5))),
    ] {
        // As after a reset: the other one waits.
        let choice = Choice::Blob(ran);
        let (mut records, _) = Records::start(&mut flash, choice, SERIAL);
        let place = Box::leak(Box::new(MaybeUninit::uninit()));
        assert!(records.load(choice, place).is_some());
        assert_eq!(records.write(sequence, change), Ok(()));
        assert!(records.word(0).is_some());
        assert_eq!(records.newest().map(|kept| kept.sequence), Some(sequence));
        assert_eq!(runs(&mut flash, choice), Some(ran), "{sequence}");
    }
    assert_eq!(runs(&mut flash, Choice::Newest), Some(crc(&blob(5))));
}
