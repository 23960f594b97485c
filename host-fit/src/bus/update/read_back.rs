//! The parameters that a node runs, read word by word.

use super::UpdateError;
use super::dialog::{Job, Wish};
use super::identity::{Identity, Pages};
use hal_adapters::can::command::{Outcome, Request};
use hal_adapters::can::update::UpdateRequest;
use runtime::ParameterSet;
use runtime::blob::MAX_BYTES;

/// Asks who the node is, and then for its blob.
#[derive(Clone, Debug, Default)]
pub struct BlobReader {
    pages: Pages,
    identity: Option<Identity>,
    blob: Vec<u8>,
    failure: Option<UpdateError>,
}

impl BlobReader {
    /// The blob that the node runs, checked, and who the node is.
    ///
    /// # Errors
    /// As [`super::Identifier::result`]; [`UpdateError::NothingRuns`]; [`UpdateError::ReadBack`].
    pub fn result(self) -> Result<(Identity, Vec<u8>), UpdateError> {
        if let Some(failure) = self.failure {
            return Err(failure);
        }
        let identity = self.identity.ok_or(UpdateError::NoAnswer)?;
        ParameterSet::from_bytes(&self.blob).map_err(|cause| UpdateError::ReadBack { cause })?;
        match &identity.running {
            Some(running) if running.are(&self.blob) => Ok((identity, self.blob)),
            _ => Err(UpdateError::Changed),
        }
    }

    /// Bytes that came, and bytes there are, once that is known.
    pub fn progress(&self) -> (u64, u64) {
        (self.blob.len() as u64, self.bytes().unwrap_or(0) as u64)
    }

    /// Length of the blob.
    fn bytes(&self) -> Option<usize> {
        let running = self.identity.as_ref()?.running.as_ref()?;
        Some((running.bytes as usize).min(MAX_BYTES))
    }
}

impl Job for BlobReader {
    fn next(&mut self) -> Wish {
        let request = match (self.pages.next(), self.bytes()) {
            _ if self.failure.is_some() => return Wish::Over,
            (Some(request), _) => request,
            (None, Some(bytes)) if self.blob.len() < bytes => {
                let index = (self.blob.len() / 4) as u8;
                Request::Update(UpdateRequest::ReadBack { index })
            }
            (None, _) => return Wish::Over,
        };
        Wish::Ask {
            request,
            transfer: None,
        }
    }

    fn answered(&mut self, request: Request, outcome: Option<Outcome>, detail: u32) {
        if let Request::Update(UpdateRequest::ReadBack { .. }) = request {
            match outcome {
                Some(Outcome::Done) => {
                    self.blob.extend(detail.to_le_bytes());
                    self.blob.truncate(self.bytes().unwrap_or(0));
                }
                _ => self.failure = Some(UpdateError::Changed),
            }
            return;
        }
        self.failure = self.pages.take(outcome, detail).err();
        if self.failure.is_none() && self.pages.next().is_none() {
            let identity = self.pages.identity();
            if identity.running.is_none() {
                self.failure = Some(UpdateError::NothingRuns);
            }
            self.identity = Some(identity);
        }
    }

    fn unanswered(&mut self) {
        self.failure = Some(UpdateError::NoAnswer);
    }

    fn interrupt(&mut self) -> bool {
        self.failure.replace(UpdateError::Interrupted).is_none()
    }
}
