extern crate std;

use super::*;
use crate::store::flash_model::{FlashModel, slots};
use crate::store::tests::{SERIAL, blob, crc, update};

fn runs(flash: &mut FlashModel, choice: Choice) -> Option<u32> {
    let (mut records, _) = Records::start(slots(flash), choice, SERIAL);
    records.load(choice)?;
    records.running().map(|running| running.id.crc)
}

#[test]
fn what_runs_stays_however_much_is_stored_before_an_activation() {
    let mut flash = FlashModel::erased();
    for number in [1, 2] {
        assert_eq!(update(&mut flash, &blob(number)), Ok(()));
    }
    let ran = crc(&blob(1));
    for (sequence, number) in [(3, 3), (4, 4), (5, 1), (6, 5)] {
        // As after a reset: the newest blob waits.
        let choice = Choice::Blob(ran);
        let (mut records, _) = Records::start(slots(&mut flash), choice, SERIAL);
        assert!(records.load(choice).is_some());
        assert_eq!(records.write(sequence, &blob(number)), Ok(()));
        assert!(records.word(0).is_some());
        assert_eq!(records.newest().map(|kept| kept.sequence), Some(sequence));
        assert_eq!(runs(&mut flash, choice), Some(ran), "{sequence}");
    }
    assert_eq!(runs(&mut flash, Choice::Newest), Some(crc(&blob(5))));
}
