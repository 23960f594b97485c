//! Who a node is, asked page by page, and the blob that it runs.

use super::UpdateError;
use super::talk::{Link, Talk, page as tell};
use hal_adapters::can::command::{Outcome, Request};
use hal_adapters::can::update::{Kept, UpdateRequest, crc_of, page};
use runtime::ParameterSet;
use runtime::blob::MAX_BYTES;

/// What a node says about itself.
#[derive(Clone, Debug, PartialEq)]
pub struct Identity {
    /// Serial number of its stage; empty if it knows none.
    pub serial: String,
    /// The parameters that it runs, if any.
    pub running: Option<RunningParameters>,
    /// The highest sequence number of any blob in its store, of one that is refused too; 0 if
    /// there is none.
    pub newest_sequence: u32,
    /// The blob that runs once it is activated or after power-on, if there is one.
    pub next: Option<Kept>,
    /// The blob before, to which it can go back.
    pub previous: Option<Kept>,
    /// Version of its program: major, minor, patch.
    pub program_version: [u8; 3],
    /// Hash of its program.
    pub program_hash: u32,
    /// Whether an update must be authorised by the stage's key.
    pub needs_key: bool,
    /// Number of the [`Outcome`] that ended the last transfer since its reset.
    pub last_update: Option<u8>,
}

/// The parameters that a node runs.
#[derive(Clone, Debug, PartialEq)]
pub struct RunningParameters {
    /// Where they lie: number of the slot.
    pub slot: u8,
    /// Whether the fit was refused and written all the same.
    pub forced: bool,
    /// Sequence number; 0 for a blob that a probe has flashed.
    pub sequence: u32,
    /// CRC-32C of the blob.
    pub crc: u32,
    /// Length of the blob, bytes.
    pub bytes: u32,
    /// When they were made, as given by the user; empty if not given.
    pub created: String,
    /// rms error of X, Y, Rz of the fit: m, m, rad.
    pub rms: [f32; 3],
    /// Peak error of X, Y, Rz of the fit: m, m, rad.
    pub peak: [f32; 3],
}

impl RunningParameters {
    /// Whether these are the parameters of `blob`, by length and check.
    pub fn are(&self, blob: &[u8]) -> bool {
        (Some(self.crc), self.bytes as usize) == (crc_of(blob), blob.len())
    }
}

/// The pages of a node, as they come.
#[derive(Clone, Debug, Default)]
struct Pages {
    /// `None`: the node has no parameters, and so no such page.
    words: Vec<Option<u32>>,
}

impl Pages {
    fn word(&self, page: u8) -> Option<u32> {
        self.words.get(usize::from(page)).copied().flatten()
    }

    fn three(&self, first: u8) -> Option<[f32; 3]> {
        let [x, y, rz] = [first, first + 1, first + 2].map(|page| self.word(page));
        Some([x?, y?, rz?].map(f32::from_bits))
    }

    fn text(&self, first: u8) -> String {
        let words = (first..first + 8).filter_map(|page| self.word(page));
        let bytes: Vec<u8> = words.flat_map(u32::to_le_bytes).collect();
        let text = bytes.split(|&byte| byte == 0).next().unwrap_or_default();
        String::from_utf8_lossy(text).into_owned()
    }

    fn running(&self) -> Option<RunningParameters> {
        let place = self.word(page::PLACE)?;
        Some(RunningParameters {
            slot: place as u8,
            forced: place >> 8 & 1 == 1,
            sequence: self.word(page::SEQUENCE)?,
            crc: self.word(page::CRC)?,
            bytes: self.word(page::LENGTH)?,
            created: self.text(page::CREATED),
            rms: self.three(page::RMS)?,
            peak: self.three(page::PEAK)?,
        })
    }

    fn kept(&self, first: u8) -> Option<Kept> {
        let (sequence, crc) = (self.word(first)?, self.word(first + 1)?);
        Some(Kept { sequence, crc })
    }

    /// All pages together.
    fn identity(&self) -> Identity {
        let [patch, minor, major, _] = self
            .word(page::PROGRAM_VERSION)
            .unwrap_or_default()
            .to_le_bytes();
        let last = self.word(page::LAST_UPDATE).unwrap_or_default();
        let outcome = last as u8;
        Identity {
            serial: self.text(page::SERIAL),
            running: self.running(),
            newest_sequence: self.word(page::NEWEST).unwrap_or_default(),
            next: self.kept(page::NEXT),
            previous: self.kept(page::PREVIOUS),
            program_version: [major, minor, patch],
            program_hash: self.word(page::PROGRAM_HASH).unwrap_or_default(),
            needs_key: last >> 8 & 1 == 1,
            last_update: (outcome != u8::MAX).then_some(outcome),
        }
    }
}

/// Asks who the node is.
///
/// # Errors
/// [`UpdateError::NoAnswer`], [`UpdateError::TellsNothing`], [`UpdateError::Unexpected`].
pub fn identify<L: Link>(talk: &mut Talk<L>) -> Result<Identity, UpdateError> {
    let mut pages = Pages::default();
    while pages.words.len() < usize::from(page::COUNT) {
        let number = pages.words.len() as u8;
        let word = ask_page(talk, number)?;
        pages.words.push(word);
        // Between the two pages another host may have stored a blob.
        if number == page::NEXT + 1 && ask_page(talk, page::NEXT)? != pages.word(page::NEXT) {
            pages.words.clear();
        }
    }
    Ok(pages.identity())
}

/// A page; `None` where the node has no parameters, and so no such page.
fn ask_page<L: Link>(talk: &mut Talk<L>, number: u8) -> Result<Option<u32>, UpdateError> {
    match talk.exchange(tell(number))? {
        (Outcome::Done, word) => Ok(Some(word)),
        (Outcome::NoParameters, _) => Ok(None),
        (outcome, detail) => Err(UpdateError::of(outcome, detail, false)),
    }
}

/// The blob that the node runs, word by word, checked, and who the node is. `progress` takes how many bytes
/// came, and of how many.
///
/// # Errors
/// As [`identify`]; [`UpdateError::NothingRuns`]; [`UpdateError::Changed`]; [`UpdateError::ReadBack`].
pub fn read_back<L: Link>(
    talk: &mut Talk<L>,
    progress: &mut dyn FnMut(u64, u64),
) -> Result<(Identity, Vec<u8>), UpdateError> {
    let identity = identify(talk)?;
    let running = identity.running.clone().ok_or(UpdateError::NothingRuns)?;
    let bytes = (running.bytes as usize).min(MAX_BYTES);
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
    match running.are(&blob) {
        true => Ok((identity, blob)),
        false => Err(UpdateError::Changed),
    }
}
