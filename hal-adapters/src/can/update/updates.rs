//! The parts of a node that take new parameters over the bus.

use super::{Nonce, Receiver, Store, UpdateData, UpdateRequest};
use crate::can::command::{Command, Outcome};
use crate::can::service::TakesUpdates;

/// What a node needs to take new parameters.
pub struct Updates<'u, 's> {
    /// The node's side of an update.
    pub receiver: &'u mut Receiver<'s>,
    /// Keeps the records.
    pub store: &'u mut dyn Store,
    /// A fresh random number; `None` without a source of any.
    pub nonce: Option<Nonce>,
}

impl TakesUpdates for Updates<'_, '_> {
    fn authorise(&mut self, command: &Command) -> Option<Option<(Outcome, u32)>> {
        (self.receiver.has_key()).then(|| self.receiver.authorise(command).err())
    }

    fn obey(&mut self, token: u8, request: UpdateRequest, servo_off: bool) -> (Outcome, u32) {
        (self.receiver).obey(token, request, servo_off, self.nonce, &mut *self.store)
    }

    fn note_answer(&mut self, command: &Command, answer: (Outcome, u32)) {
        self.receiver.note_answer(command, answer);
    }

    fn take(&mut self, data: &UpdateData) {
        self.receiver.take(data);
    }
}
