//! Who a node is, asked page by page.

use super::UpdateError;
use super::dialog::{Job, Wish};
use hal_adapters::can::command::{Outcome, Request};
use hal_adapters::can::update::{Kept, UpdateRequest, crc_of, page};

/// What a node tells of itself.
#[derive(Clone, Debug, PartialEq)]
pub struct Identity {
    /// Serial number of its stage; empty if it knows none.
    pub serial: String,
    /// The parameters that it runs, if any.
    pub running: Option<RunningParameters>,
    /// The highest sequence number of any record in its store, of one that is refused too; 0 if
    /// there is none.
    pub newest_sequence: u32,
    /// The record that runs from its next reset on, if there is one.
    pub next: Option<Kept>,
    /// The record before, to which it can go back.
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
    /// Where they lie: number of the sector or slot.
    pub slot: u8,
    /// Whether the fit was refused and written all the same.
    pub forced: bool,
    /// Sequence number of the record; 0 for a blob that a probe has flashed.
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
pub(super) struct Pages {
    /// `None`: the node has no parameters, and so no such page.
    words: Vec<Option<u32>>,
    /// Whether the number of the next record was the same after its check was told.
    is_settled: bool,
}

impl Pages {
    /// What to ask for next; `None` once every page is there.
    pub(super) fn next(&self) -> Option<Request> {
        let page = match u8::try_from(self.words.len()).ok()? {
            // Between the two pages another host may have stored a record.
            page::PREVIOUS if !self.is_settled => page::NEXT,
            page => page,
        };
        (page < page::COUNT).then_some(Request::Update(UpdateRequest::Tell { page }))
    }

    /// Takes the answer to the last request.
    pub(super) fn take(&mut self, outcome: Option<Outcome>, word: u32) -> Result<(), UpdateError> {
        let word = match outcome {
            Some(Outcome::Done) => Some(word),
            Some(Outcome::NoParameters) => None,
            Some(Outcome::UnknownCommand) => return Err(UpdateError::TellsNothing),
            outcome => return Err(UpdateError::Unexpected { outcome }),
        };
        if self.words.len() != usize::from(page::PREVIOUS) || self.is_settled {
            self.words.push(word);
        } else if word == self.word(page::NEXT) {
            self.is_settled = true;
        } else {
            self.words.clear();
        }
        Ok(())
    }

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
    pub(super) fn identity(&self) -> Identity {
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
#[derive(Clone, Debug, Default)]
pub struct Identifier {
    pages: Pages,
    failure: Option<UpdateError>,
}

impl Identifier {
    /// What came of it.
    ///
    /// # Errors
    /// [`UpdateError::NoAnswer`], [`UpdateError::TellsNothing`], [`UpdateError::Unexpected`].
    pub fn result(self) -> Result<Identity, UpdateError> {
        match self.failure {
            Some(failure) => Err(failure),
            None => Ok(self.pages.identity()),
        }
    }
}

impl Job for Identifier {
    fn next(&mut self) -> Wish {
        match self.pages.next() {
            Some(request) if self.failure.is_none() => Wish::Ask {
                request,
                transfer: None,
            },
            _ => Wish::Over,
        }
    }

    fn answered(&mut self, _request: Request, outcome: Option<Outcome>, detail: u32) {
        self.failure = self.pages.take(outcome, detail).err();
    }

    fn unanswered(&mut self) {
        self.failure = Some(UpdateError::NoAnswer);
    }

    fn interrupt(&mut self) -> bool {
        self.failure.replace(UpdateError::Interrupted).is_none()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn where_the_next_record_changes_between_its_pages_all_are_asked_anew() {
        let (mut pages, mut asked) = (Pages::default(), 0);
        let told = |page, asked| match page {
            // Another host stores number 8 once the number was told.
            page::NEXT if asked <= 31 => 7,
            page::NEXT => 8,
            page if page == page::NEXT + 1 => 0x88,
            page => page.into(),
        };
        while let Some(request) = pages.next() {
            asked += 1;
            let Request::Update(UpdateRequest::Tell { page }) = request else {
                panic!("{request:?}");
            };
            let taken = pages.take(Some(Outcome::Done), told(page, asked));
            assert_eq!(taken, Ok(()));
        }
        let (sequence, crc) = (8, 0x88);
        assert_eq!(pages.identity().next, Some(Kept { sequence, crc }));
        assert_eq!(asked, 33 + 35);
    }
}
