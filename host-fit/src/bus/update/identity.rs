//! The identity of a node, asked page by page, and the blob that it runs.

use super::UpdateError;
use super::talk::{Link, Talk, page as tell};
use hal_adapters::can::command::{Outcome, Request};
use hal_adapters::can::update::{BlobId, UpdateRequest, blob_crc, page};
use runtime::ParameterSet;
use runtime::blob::MAX_BYTES;

/// The answers of a node to [`identify`].
#[derive(Clone, Debug, PartialEq)]
pub struct Identity {
    /// Serial number of its stage; empty without one.
    pub serial: String,
    /// The blob that runs, and its length in bytes.
    pub running: Option<(BlobId, u32)>,
    /// The highest sequence number in its store, refused blobs included; 0 for none.
    pub newest_sequence: u32,
    /// The blob that runs after an activation or power-on.
    pub next: Option<BlobId>,
    /// Version of its program: major, minor, patch.
    pub program_version: [u8; 3],
    /// Whether an update must be authorised by the stage's key.
    pub needs_key: bool,
}

/// Asks for the identity of the node.
///
/// # Errors
/// [`UpdateError::NoAnswer`], [`UpdateError::TellsNothing`], [`UpdateError::Unexpected`].
pub fn identify<L: Link>(talk: &mut Talk<L>) -> Result<Identity, UpdateError> {
    let program = ask_page(talk, page::PROGRAM)?.unwrap_or_default();
    let [patch, minor, major, needs_key] = program.to_le_bytes();
    let running = ask_blob(talk, page::RUNNING_SEQUENCE, page::RUNNING_CRC)?;
    let bytes = ask_page(talk, page::RUNNING_BYTES)?;
    Ok(Identity {
        serial: ask_serial(talk)?,
        running: running.zip(bytes),
        newest_sequence: ask_page(talk, page::NEWEST_SEQUENCE)?.unwrap_or_default(),
        next: ask_next(talk)?,
        program_version: [major, minor, patch],
        needs_key: needs_key & 1 == 1,
    })
}

fn ask_serial<L: Link>(talk: &mut Talk<L>) -> Result<String, UpdateError> {
    let mut serial = Vec::new();
    for number in page::SERIAL..page::COUNT {
        let word = ask_page(talk, number)?.unwrap_or_default();
        serial.extend(word.to_le_bytes());
    }
    let text = serial.split(|&byte| byte == 0).next().unwrap_or_default();
    Ok(String::from_utf8_lossy(text).into_owned())
}

/// The blob that runs after an activation or power-on.
pub(super) fn ask_next<L: Link>(talk: &mut Talk<L>) -> Result<Option<BlobId>, UpdateError> {
    ask_blob(talk, page::NEXT_SEQUENCE, page::NEXT_CRC)
}

/// The blob that runs.
pub(super) fn ask_running<L: Link>(talk: &mut Talk<L>) -> Result<Option<BlobId>, UpdateError> {
    ask_blob(talk, page::RUNNING_SEQUENCE, page::RUNNING_CRC)
}

fn ask_blob<L: Link>(
    talk: &mut Talk<L>,
    sequence: u8,
    crc: u8,
) -> Result<Option<BlobId>, UpdateError> {
    let (sequence, crc) = (ask_page(talk, sequence)?, ask_page(talk, crc)?);
    let blob = sequence.zip(crc);
    Ok(blob.map(|(sequence, crc)| BlobId { sequence, crc }))
}

/// A fact; `None` where the node has no parameters, and so no such fact.
pub(super) fn ask_page<L: Link>(
    talk: &mut Talk<L>,
    number: u8,
) -> Result<Option<u32>, UpdateError> {
    match talk.exchange(tell(number))? {
        (Outcome::Done, word) => Ok(Some(word)),
        (Outcome::NoParameters, _) => Ok(None),
        (outcome, detail) => Err(UpdateError::from_outcome(outcome, detail, false)),
    }
}

/// Reads the blob that the node runs, word by word, and checks it. Also gives the identity of the node.
/// `progress` takes the bytes received and the bytes in all.
///
/// # Errors
/// As [`identify`]; [`UpdateError::NothingRuns`]; [`UpdateError::Changed`]; [`UpdateError::ReadBack`].
pub fn read_back<L: Link>(
    talk: &mut Talk<L>,
    progress: &mut dyn FnMut(u64, u64),
) -> Result<(Identity, Vec<u8>), UpdateError> {
    let identity = identify(talk)?;
    let (running, bytes) = identity.running.ok_or(UpdateError::NothingRuns)?;
    let bytes = (bytes as usize).min(MAX_BYTES);
    let mut blob = Vec::new();
    for index in 0..bytes.div_ceil(4) {
        let index = index as u8;
        let read = Request::Update(UpdateRequest::ReadBack { index });
        match talk.exchange(read)? {
            (Outcome::Done, word) => blob.extend(word.to_le_bytes()),
            _ => return Err(UpdateError::Changed),
        }
        progress(blob.len() as u64, bytes as u64);
    }
    blob.truncate(bytes);
    ParameterSet::from_bytes(&blob).map_err(|cause| UpdateError::ReadBack { cause })?;
    match blob_crc(&blob) == Some(running.crc) {
        true => Ok((identity, blob)),
        false => Err(UpdateError::Changed),
    }
}
