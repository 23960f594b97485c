extern crate std;

use super::*;
use crate::store::flash_model::FlashModel;
use crate::store::tests::{SERIAL, blob, crc, start, update};
use std::boxed::Box;

fn runs(flash: &mut FlashModel, choice: Choice) -> Option<u32> {
    let (mut records, _) = Records::start(flash, choice, SERIAL);
    let place = Box::leak(Box::new(MaybeUninit::uninit()));
    records.load(choice, place).map(|loaded| loaded.crc)
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
