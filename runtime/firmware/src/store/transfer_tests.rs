//! Pieces that are lost, repeated, swapped and foreign; two masters; noise.

extern crate std;

use super::flash_model::{FlashModel, Words};
use super::tests::{SERIAL, blob, found};
use super::transfer::{IDLE_MS, Offer, Progress, Transfer, TransferRefused};
use super::*;
use runtime::blob::MAX_BYTES;
use std::vec::Vec;

fn offer(blob: &[u8], sequence: u32) -> Offer<'static> {
    Offer {
        bytes: blob.len(),
        crc: u32::from_le_bytes(*blob.last_chunk().expect("long")),
        serial: "HS-0007",
        sequence,
    }
}

fn started() -> (FlashModel, Store) {
    let mut flash = FlashModel::erased();
    let store = Store::start(&mut flash, SERIAL);
    flash.operations = 0;
    (flash, store)
}

/// Writes what was committed.
fn write(transfer: &mut Transfer, store: &mut Store, flash: &mut FlashModel) -> Progress {
    loop {
        match transfer.step(store, flash).expect("sound flash") {
            Progress::Writing => {}
            end => return end,
        }
    }
}

#[test]
fn a_blob_in_pieces_of_any_order_is_written_once_it_is_complete() {
    let (mut flash, mut store) = started();
    let mut words = Words(3);
    for round in 0..40 {
        let blob = blob(round);
        let mut transfer = Transfer::IDLE;
        let sequence = store.due().expect("due");
        assert_eq!(
            transfer.begin(&store, 7, &offer(&blob, sequence), 0),
            Ok(())
        );
        let piece = 4 * (1 + words.below(3) as usize);
        let mut missing: Vec<usize> = (0..blob.len()).step_by(piece).collect();
        let before = flash.operations;
        while !missing.is_empty() {
            assert!(matches!(
                transfer.verify(&store, 7, 0),
                Err(TransferRefused::Missing { .. })
            ));
            let refused = Err(TransferRefused::NotVerified);
            assert_eq!(transfer.commit(&mut store, &flash, 7, 0), refused);
            let offset = missing.swap_remove(words.below(missing.len() as u32) as usize);
            for _ in 0..1 + words.below(2) {
                let end = blob.len().min(offset + piece);
                assert_eq!(transfer.data(7, offset, &blob[offset..end], 0), Ok(()));
            }
        }
        for _ in 0..2 {
            assert_eq!(transfer.verify(&store, 7, 0), Ok(()));
            assert_eq!(transfer.data(7, 0, &blob[..8], 0), Ok(()));
        }
        assert_eq!(flash.operations, before, "not written before the commit");
        match transfer.commit(&mut store, &flash, 7, 0) {
            Err(TransferRefused::Store(Refused::NoRoom)) => {
                store = Store::start(&mut flash, SERIAL);
                assert_eq!(
                    transfer.commit(&mut store, &flash, 7, 0),
                    Ok(Progress::Writing)
                );
            }
            committed => assert_eq!(committed, Ok(Progress::Writing)),
        }
        assert_eq!(
            transfer.commit(&mut store, &flash, 7, 0),
            Ok(Progress::Writing)
        );
        assert_eq!(transfer.abort(7, 0), Err(TransferRefused::Busy));
        let done = Progress::Done { sequence };
        assert_eq!(write(&mut transfer, &mut store, &mut flash), done);
        assert_eq!(transfer.commit(&mut store, &flash, 7, 0), Ok(done));
        assert_eq!(transfer.step(&mut store, &mut flash), Ok(Progress::Idle));
        assert_eq!(found(&Store::read(&flash, SERIAL), &flash), Some(blob));
    }
}

#[test]
fn the_second_master_waits_and_then_learns_that_it_was_late() {
    let (mut flash, mut store) = started();
    let mut transfer = Transfer::IDLE;
    let [one, other] = [1, 2].map(blob);
    assert_eq!(transfer.begin(&store, 1, &offer(&one, 1), 0), Ok(()));
    assert_eq!(transfer.data(1, 0, &one[..8], 10), Ok(()));
    let late = 10 + IDLE_MS - 1;
    let foreign = [
        transfer.begin(&store, 2, &offer(&other, 1), late),
        transfer.data(2, 8, &other[8..12], late),
        transfer.verify(&store, 2, late),
        transfer.abort(2, late),
    ];
    let no = Err(TransferRefused::NoSession);
    assert_eq!(foreign, [Err(TransferRefused::Busy), no, no, no]);
    // The same offer again keeps what is there.
    assert_eq!(transfer.begin(&store, 1, &offer(&one, 1), 20), Ok(()));
    assert_eq!(transfer.data(1, 8, &one[8..], 20), Ok(()));
    assert_eq!(transfer.verify(&store, 1, 20), Ok(()));
    assert_eq!(
        transfer.commit(&mut store, &flash, 1, 20),
        Ok(Progress::Writing)
    );
    let busy = Err(TransferRefused::Busy);
    assert_eq!(
        transfer.begin(&store, 2, &offer(&other, 1), u32::MAX / 2),
        busy
    );
    write(&mut transfer, &mut store, &mut flash);
    let due = Err(TransferRefused::Store(Refused::Sequence { due: 2 }));
    for (token, blob) in [(2, &other), (1, &one)] {
        assert_eq!(transfer.begin(&store, token, &offer(blob, 1), 30), due);
    }
    // A master that fell silent does not stand in the way for ever.
    assert_eq!(transfer.begin(&store, 2, &offer(&other, 2), 40), Ok(()));
    let taken = transfer.begin(&store, 3, &offer(&other, 2), 40 + IDLE_MS);
    assert_eq!((taken, transfer.abort(2, 0)), (Ok(()), no));
    assert_eq!((transfer.abort(3, 0), transfer.is_open()), (Ok(()), false));
    assert_eq!(transfer.begin(&store, 1, &offer(&one, 2), 0), Ok(()));
    transfer.expire(IDLE_MS - 1);
    assert!(transfer.is_open());
    transfer.expire(IDLE_MS);
    assert!(!transfer.is_open());
}

#[test]
fn what_is_wrong_with_a_transfer_is_told() {
    let (flash, mut store) = started();
    let mut transfer = Transfer::IDLE;
    let blob = blob(1);
    let good = offer(&blob, 1);
    for bytes in [0, 4, MAX_BYTES + 1, usize::MAX] {
        let refused = Err(TransferRefused::Length { bytes });
        assert_eq!(
            transfer.begin(&store, 1, &Offer { bytes, ..good }, 0),
            refused
        );
    }
    let other = Err(TransferRefused::Store(Refused::Blob(BlobError::OtherStage)));
    assert_eq!(
        transfer.begin(
            &store,
            1,
            &Offer {
                serial: "HS-0008",
                ..good
            },
            0
        ),
        other
    );
    let crc = !good.crc;
    assert_eq!(transfer.begin(&store, 1, &Offer { crc, ..good }, 0), Ok(()));
    for (offset, bytes) in [
        (2, 4),
        (0, 3),
        (0, 0),
        (blob.len() - 3, 4),
        (usize::MAX - 3, 4),
        (4, MAX_BYTES),
    ] {
        let refused = Err(TransferRefused::Misplaced { offset });
        assert_eq!(
            transfer.data(1, offset, &[0; MAX_BYTES][..bytes], 0),
            refused
        );
    }
    assert_eq!(transfer.data(1, 0, &blob, 0), Ok(()));
    let mut changed = blob.clone();
    changed[41] ^= 1;
    let differs = Err(TransferRefused::Differs { offset: 40 });
    assert_eq!(transfer.data(1, 0, &changed, 0), differs);
    let staged = good.crc;
    assert_eq!(
        transfer.verify(&store, 1, 0),
        Err(TransferRefused::OtherCrc { staged })
    );
    let missing = Err(TransferRefused::Missing { offset: 0 });
    assert_eq!(transfer.verify(&store, 1, 0), missing);
    // The check that was announced, and yet damaged; sent again, it is sound.
    assert_eq!(transfer.begin(&store, 1, &good, 0), Ok(()));
    assert_eq!(transfer.data(1, 0, &changed, 0), Ok(()));
    let verified = transfer.verify(&store, 1, 0);
    assert!(matches!(
        verified,
        Err(TransferRefused::Store(Refused::Blob(
            BlobError::BadCrc { .. }
        )))
    ));
    assert_eq!(
        transfer.commit(&mut store, &flash, 1, 0),
        Err(TransferRefused::NotVerified)
    );
    assert_eq!(transfer.data(1, 0, &blob, 0), Ok(()));
    assert_eq!(transfer.verify(&store, 1, 0), Ok(()));
    assert_eq!(flash.operations, 0);
}

/// Sends a random message, and lets the writing go on.
fn disturb(
    words: &mut Words,
    transfer: &mut Transfer,
    store: &mut Store,
    flash: &mut FlashModel,
    blobs: &[Vec<u8>],
    sound: bool,
) {
    let token = words.below(2);
    let now_ms = words.below(4) * IDLE_MS / 2;
    // Each master has its blob, and a frame in 400 is the other's.
    let blob = &blobs[(token + u32::from(words.below(400) == 0)) as usize % blobs.len()];
    match words.below(40) {
        0 => {
            let mut offer = offer(
                blob,
                store
                    .due()
                    .expect("not all")
                    .wrapping_add(words.below(8) / 7),
            );
            if words.below(8) == 0 {
                offer.crc = words.next();
            }
            let _ = transfer.begin(store, token, &offer, now_ms);
        }
        1 => drop(transfer.verify(store, token, now_ms)),
        2 => drop(transfer.commit(store, flash, token, now_ms)),
        3 if words.below(20) == 0 => drop(transfer.abort(token, now_ms)),
        4..8 => drop(transfer.step(store, flash)),
        _ => {
            let from = 64 * words.below(11) as usize;
            let mut piece = blob[from.min(blob.len())..blob.len().min(from + 64)].to_vec();
            if !sound || words.below(50) == 0 {
                piece
                    .iter_mut()
                    .for_each(|byte| *byte ^= words.next() as u8);
            }
            let _ = transfer.data(token, from, &piece, now_ms);
        }
    }
}

#[test]
fn a_million_messages_of_noise_write_nothing() {
    let (mut flash, mut store) = started();
    let mut transfer = Transfer::IDLE;
    let mut words = Words(11);
    let blobs = [1, 2].map(blob);
    for _ in 0..1_000_000 {
        disturb(
            &mut words,
            &mut transfer,
            &mut store,
            &mut flash,
            &blobs,
            false,
        );
    }
    assert_eq!((flash.operations, store.due()), (0, Some(1)));
}

#[test]
fn two_masters_at_once_over_a_bad_bus_write_only_whole_blobs() {
    let (mut flash, mut store) = started();
    let mut transfer = Transfer::IDLE;
    let mut words = Words(12);
    let blobs = [1, 2].map(blob);
    let mut written = 0;
    for message in 0..1_000_000 {
        let due = store.due();
        disturb(
            &mut words,
            &mut transfer,
            &mut store,
            &mut flash,
            &blobs,
            true,
        );
        if store.due() != due || message % 10_000 == 0 {
            written += usize::from(store.due() != due);
            if !transfer.is_open() {
                store = Store::start(&mut flash, SERIAL);
            }
            let found = found(&Store::read(&flash, SERIAL), &flash);
            assert!(found.is_none_or(|found| blobs.contains(&found)));
        }
    }
    assert!(written > 300, "{written}");
}
