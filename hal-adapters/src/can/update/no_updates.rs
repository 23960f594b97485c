//! Without the feature `update` a node takes no parameters over the bus.

use super::{UpdateData, UpdateRequest};
use crate::can::command::{Command, Outcome};
use core::convert::Infallible;
use core::marker::PhantomData;

/// There is none: see the feature `update`.
pub struct Updates<'u, 's>(Infallible, PhantomData<(&'u (), &'s ())>);

impl Updates<'_, '_> {
    pub(in crate::can) fn authorise(&self, _: &Command) -> Option<Option<(Outcome, u32)>> {
        match self.0 {}
    }

    pub(in crate::can) fn obey(&self, _: u8, _: UpdateRequest, _: bool) -> (Outcome, u32) {
        match self.0 {}
    }

    pub(in crate::can) fn note_answer(&self, _: &Command, _: (Outcome, u32)) {
        match self.0 {}
    }

    pub(in crate::can) fn take(&self, _: &UpdateData) {
        match self.0 {}
    }
}
