//! What the node is to keep in the end, and whether it does.

use super::UpdateError;
use super::identity::Identity;
use super::plan::Wanted;
use hal_adapters::can::update::crc_of;

/// What the node is to keep: settled by what it kept when it was first asked. So nothing is undone
/// that another host does meanwhile, and what was asked for is not done twice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Goal {
    /// The highest sequence number in the store.
    base: u32,
    /// CRC-32C of the blob that is to run.
    pub(super) crc: u32,
    /// The least sequence number of a record that will do.
    least: u32,
    /// Whether it can be stored, if it is not there.
    is_storable: bool,
}

/// What the node has of a goal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Found {
    /// A record that runs, or will from the next reset on.
    Record {
        /// Its sequence number.
        sequence: u32,
        /// Whether it runs.
        runs: bool,
    },
    /// None yet, and nothing has changed since the goal was settled.
    Nothing,
}

impl Goal {
    /// What is wanted of a node that tells this.
    ///
    /// # Errors
    /// [`UpdateError::NoPrevious`], [`UpdateError::NothingKept`].
    pub(super) fn of(wanted: &Wanted, identity: &Identity) -> Result<Self, UpdateError> {
        let base = identity.newest_sequence;
        let (crc, least) = match wanted {
            Wanted::Blob(blob) => (crc_of(blob).unwrap_or_default(), 0),
            Wanted::Previous => {
                let previous = identity.previous.ok_or(UpdateError::NoPrevious)?;
                (previous.crc, base.saturating_add(1))
            }
            Wanted::Newest => (identity.next.ok_or(UpdateError::NothingKept)?.crc, 0),
        };
        Ok(Self {
            base,
            crc,
            least,
            is_storable: *wanted != Wanted::Newest,
        })
    }

    /// Sequence number of a new record.
    pub(super) const fn sequence(&self) -> u32 {
        self.base.saturating_add(1)
    }

    /// What the node has of it.
    ///
    /// # Errors
    /// [`UpdateError::Overtaken`], [`UpdateError::NumbersUsedUp`].
    pub(super) fn found(&self, identity: &Identity) -> Result<Found, UpdateError> {
        let is_wanted = |crc, sequence| crc == self.crc && sequence >= self.least;
        if let Some(next) = identity
            .next
            .filter(|next| is_wanted(next.crc, next.sequence))
        {
            let running = identity.running.as_ref();
            return Ok(Found::Record {
                sequence: next.sequence,
                runs: running.is_some_and(|r| (r.sequence, r.crc) == (next.sequence, next.crc)),
            });
        }
        if identity.newest_sequence != self.base || !self.is_storable {
            let least = identity.newest_sequence.saturating_add(1);
            return Err(UpdateError::Overtaken { least });
        }
        match self.base {
            u32::MAX => Err(UpdateError::NumbersUsedUp),
            _ => Ok(Found::Nothing),
        }
    }
}
