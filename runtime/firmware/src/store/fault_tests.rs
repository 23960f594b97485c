//! Writes that were not finished, and words that do not hold.

extern crate std;

use super::flash::BLANK;
use super::flash_model::FlashModel;
use super::record::{UNIT_BYTES, units};
use super::tests::{SERIAL, blob, found, record, update, write};
use super::*;

#[test]
fn a_write_that_was_not_finished_bars_others_until_the_next_start() {
    let mut flash = FlashModel::erased();
    let mut store = Store::start(&mut flash, SERIAL);
    let record = record(&store, &blob(1)).expect("due");
    let mut writing = store.begin(&flash, &record).expect("room");
    assert_eq!(writing.step(&mut flash, &record), Ok(Step::More));
    assert_eq!(
        store.begin(&flash, &record).map(|_| ()),
        Err(Refused::Unsettled)
    );
    store.finish(&flash, &writing);
    assert_eq!(
        store.begin(&flash, &record).map(|_| ()),
        Err(Refused::Unsettled)
    );
    let mut store = Store::start(&mut flash, SERIAL);
    assert_eq!(write(&mut store, &mut flash, &record), Ok(()));
}

#[test]
fn a_word_that_does_not_hold_is_told_and_nothing_is_committed() {
    let mut flash = FlashModel::erased();
    let mut store = Store::start(&mut flash, SERIAL);
    let record = record(&store, &blob(1)).expect("due");
    let mut writing = store.begin(&flash, &record).expect("room");
    for _ in 0..30 {
        assert_eq!(writing.step(&mut flash, &record), Ok(Step::More));
    }
    // Some other program's fault: a word ahead is not blank, and one behind has changed.
    let mut ahead = (flash.clone(), Writing { ..writing });
    ahead.0.program(Sector::First, 16 + 40, 0).expect("on");
    flash.program(Sector::First, 16 + 20, 0).expect("on");
    for (flash, writing) in [(&mut ahead.0, &mut ahead.1), (&mut flash, &mut writing)] {
        let fault = (0..200).find_map(|_| writing.step(flash, &record).err());
        assert!(matches!(fault, Some(WriteFault::ReadsOtherwise { .. })));
        assert_eq!(Store::start(flash, SERIAL).newest(), None);
    }
}

#[test]
fn a_worn_word_costs_one_update_at_most_wherever_it_is() {
    let mut sound = FlashModel::erased();
    let mut store = Store::start(&mut sound, SERIAL);
    assert_eq!(update(&mut store, &mut sound, &blob(0)), Ok(()));
    let record = record(&store, &blob(1)).expect("due");
    let first = (1 + units(blob(0).len())) * UNIT_BYTES / 4;
    let commit = first + record.body_words();
    for word in first..commit + 2 {
        let mut flash = sound.clone();
        let mut store = Store::start(&mut flash, SERIAL);
        flash.stuck = Some((Sector::First, word));
        let written = write(&mut store, &mut flash, &record);
        // A word that stays blank does no harm where it should, nor where the seal should be.
        let harmless = word > commit || word < commit && record.word(word - first) == BLANK;
        assert_eq!(written.is_ok(), harmless, "{word}");
        assert_eq!(store.is_writable(), harmless, "{word}");
        let mut store = Store::start(&mut flash, SERIAL);
        let expected = blob(usize::from(harmless));
        assert_eq!(found(&store, &flash), Some(expected.clone()), "{word}");
        assert_eq!((store.fault(), store.is_writable()), (None, true), "{word}");
        for number in 2..4 {
            let before = found(&store, &flash);
            assert_eq!(update(&mut store, &mut flash, &blob(number)), Ok(()));
            store = Store::start(&mut flash, SERIAL);
            assert_eq!(found(&store, &flash), Some(blob(number)), "{word}");
            let previous = store.previous().map(|stored| stored.blob(&flash).to_vec());
            assert_eq!(previous, before, "{word}");
        }
    }
}

/// Flash that reports an error of one operation, which it has done all the same.
struct Reporting<'f> {
    flash: &'f mut FlashModel,
    at: usize,
}

impl Flash for Reporting<'_> {
    fn bytes(&self, sector: Sector) -> &[u8; SECTOR_BYTES] {
        self.flash.bytes(sector)
    }

    fn program(&mut self, sector: Sector, word: usize, value: u32) -> Result<(), FlashFault> {
        self.flash.program(sector, word, value)?;
        match self.flash.operations - 1 == self.at {
            true => Err(FlashFault { status: 1 << 7 }),
            false => Ok(()),
        }
    }

    fn erase(&mut self, sector: Sector) -> Result<(), FlashFault> {
        self.flash.erase(sector)
    }
}

#[test]
fn after_an_error_of_the_flash_the_record_does_not_count_though_it_is_whole() {
    let mut sound = FlashModel::erased();
    let mut store = Store::start(&mut sound, SERIAL);
    assert_eq!(update(&mut store, &mut sound, &blob(0)), Ok(()));
    let record = record(&store, &blob(1)).expect("due");
    for at in 0..record.body_words() + 1 {
        let mut flash = sound.clone();
        let mut store = Store::start(&mut flash, SERIAL);
        flash.power_on();
        let mut writing = store.begin(&flash, &record).expect("room");
        let mut reporting = Reporting {
            flash: &mut flash,
            at,
        };
        let step = (0..=at).find_map(|_| writing.step(&mut reporting, &record).err());
        assert!(matches!(step, Some(WriteFault::Flash { .. })), "{at}");
        let mut store = Store::start(&mut flash, SERIAL);
        assert_eq!(found(&store, &flash), Some(blob(0)), "{at}");
        assert_eq!(update(&mut store, &mut flash, &blob(2)), Ok(()), "{at}");
        let store = Store::start(&mut flash, SERIAL);
        assert_eq!(found(&store, &flash), Some(blob(2)), "{at}");
    }
}

#[test]
fn a_worn_commit_word_that_reads_again_is_older_than_what_was_written_since() {
    let mut flash = FlashModel::erased();
    let mut store = Store::start(&mut flash, SERIAL);
    let record = record(&store, &blob(1)).expect("due");
    let commit = UNIT_BYTES / 4 + record.body_words();
    flash.stuck = Some((Sector::First, commit));
    assert!(write(&mut store, &mut flash, &record).is_err());
    let mut store = Store::start(&mut flash, SERIAL);
    assert_eq!(store.due(), Some(2));
    assert_eq!(update(&mut store, &mut flash, &blob(2)), Ok(()));
    flash.stuck = None;
    (flash.program(Sector::First, commit, record::COMMIT)).expect("on");
    let store = Store::start(&mut flash, SERIAL);
    assert_eq!(found(&store, &flash), Some(blob(2)));
}

#[test]
fn a_sector_that_cannot_be_renewed_leaves_the_other_one() {
    let mut empty = FlashModel::erased();
    // Neither is a journal, nor holds a blob.
    for sector in Sector::ALL {
        empty.load(sector, &[0; SECTOR_BYTES]);
    }
    for word in [0, 1, 500] {
        let mut flash = empty.clone();
        flash.stuck = Some((Sector::First, word));
        let mut store = Store::start(&mut flash, SERIAL);
        assert_eq!((store.fault(), store.is_writable()), (None, true), "{word}");
        assert_eq!(update(&mut store, &mut flash, &blob(1)), Ok(()));
        let store = Store::start(&mut flash, SERIAL);
        let newest = store.newest().expect("written");
        assert_eq!(newest.sector, Sector::Second);
    }
    // One that holds the newest blob is never erased, and it is told that there is no way.
    for word in [0, 1, 500] {
        let mut flash = empty.clone();
        flash.load(Sector::Second, &blob(1));
        flash.stuck = Some((Sector::First, word));
        let mut store = Store::start(&mut flash, SERIAL);
        let fault = store.fault();
        assert!(matches!(fault, Some(WriteFault::ReadsOtherwise { .. })));
        assert!(!store.is_writable());
        let refused = update(&mut store, &mut flash, &blob(2));
        assert_eq!(refused, Err(Refused::Unsettled), "{word}");
        assert_eq!(found(&store, &flash), Some(blob(1)));
    }
}

#[test]
fn beside_records_that_are_refused_no_plain_blob_is_erased() {
    let mut flash = FlashModel::erased();
    flash.load(Sector::First, &blob(0));
    let mut store = Store::start(&mut flash, SERIAL);
    while update(&mut store, &mut flash, &blob(1)).is_ok() {}
    let before = flash.clone();
    let store = Store::start(&mut flash, Some("HS-0008"));
    assert_eq!((store.newest(), store.is_writable()), (None, false));
    assert_eq!(flash, before);
}

#[test]
fn two_plain_blobs_that_are_refused_are_not_erased_and_nothing_can_be_written() {
    let mut flash = FlashModel::erased();
    for sector in Sector::ALL {
        flash.load(sector, &blob(1));
    }
    let before = flash.clone();
    let store = Store::start(&mut flash, Some("HS-0008"));
    assert_eq!((store.newest(), store.is_writable()), (None, false));
    assert_eq!(flash, before);
}
