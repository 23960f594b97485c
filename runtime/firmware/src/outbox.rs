//! Frames that wait for a mailbox of the CAN controller.
//!
//! The controller sends the lowest identifier of its three mailboxes first, and the older of two equal identifiers
//! not always first. Frames shall go out in the order of their pushes, so the mailboxes hold one frame, or one
//! group, at a time. A group is up to three frames with rising identifiers. The next frame follows when all mailboxes
//! are empty.

use hal_adapters::can::{Coded, Message};
use heapless::Deque;

/// Frames of one tick at most: X, Y, Rz, their time, a vertical axis, temperatures, three of codes,
/// their time, a state or a counter.
const FRESH_MAX: usize = 11;
/// Answers to the commands of a few ticks.
const LASTING_MAX: usize = 8;

/// A queue in two parts. The next tick discards and counts poses, codes, states and counters, which are then out of
/// date. Answers are sent only once and wait as long as it takes.
#[derive(Debug, Default)]
pub struct Outbox {
    /// Frames of this tick; true: it may join the previous frame in the mailboxes.
    fresh: Deque<(Coded, bool), FRESH_MAX>,
    lasting: Deque<Coded, LASTING_MAX>,
    dropped: u32,
}

impl Outbox {
    /// An empty box.
    pub const fn new() -> Self {
        Self {
            fresh: Deque::new(),
            lasting: Deque::new(),
            dropped: 0,
        }
    }

    /// Whether a frame is still worth sending after its tick.
    pub const fn is_lasting(message: Message) -> bool {
        matches!(message, Message::Answer)
    }

    /// Adds a frame at the end.
    pub fn push(&mut self, frame: Coded) {
        let full = if Self::is_lasting(frame.message) {
            self.lasting.push_back(frame).is_err()
        } else {
            self.fresh.push_back((frame, false)).is_err()
        };
        self.count_dropped(u32::from(full));
    }

    /// Adds a group at the end: up to three frames of this tick with rising identifiers.
    pub fn push_group(&mut self, frames: &[Coded]) {
        let mut joins = false;
        for frame in frames {
            let full = self.fresh.push_back((*frame, joins)).is_err();
            self.count_dropped(u32::from(full));
            joins = true;
        }
    }

    /// The next frame for a mailbox, if one may be filled now; it stays until [`Self::pop`]. `all_empty`: no mailbox holds
    /// a frame.
    pub fn front(&self, all_empty: bool) -> Option<&Coded> {
        match self.fresh.front() {
            Some((frame, joins)) => (all_empty || *joins).then_some(frame),
            None => self.lasting.front().filter(|_| all_empty),
        }
    }

    /// Whether no frame waits.
    pub fn is_empty(&self) -> bool {
        self.front(true).is_none()
    }

    /// Removes the frame that [`Self::front`] gave.
    pub fn pop(&mut self) -> Option<Coded> {
        let fresh = self.fresh.pop_front().map(|(frame, _)| frame);
        fresh.or_else(|| self.lasting.pop_front())
    }

    /// Discards the frames of the previous tick that are out of date.
    pub fn start_tick(&mut self) {
        self.count_dropped(self.fresh.len() as u32);
        self.fresh.clear();
    }

    /// Frames that were never sent. Saturates.
    pub const fn dropped(&self) -> u32 {
        self.dropped
    }

    /// Counts frames that a mailbox did not send.
    pub const fn count_dropped(&mut self, frames: u32) {
        self.dropped = self.dropped.saturating_add(frames);
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;
    use std::vec::Vec;

    const fn frame(message: Message) -> Coded {
        Coded {
            message,
            bytes: [0; 8],
        }
    }

    #[test]
    fn frames_left_over_and_frames_too_many_are_counted() {
        let mut outbox = Outbox::new();
        (0..FRESH_MAX + 2).for_each(|_| outbox.push(frame(Message::PoseX)));
        assert_eq!(outbox.dropped(), 2);
        assert_eq!(outbox.pop(), Some(frame(Message::PoseX)));
        outbox.start_tick();
        assert_eq!(outbox.dropped(), 2 + FRESH_MAX as u32 - 1);
        assert_eq!(outbox.front(true), None);
    }

    #[test]
    fn answers_outlive_their_tick_and_let_the_next_pose_pass() {
        let mut outbox = Outbox::new();
        for message in [Message::PoseX, Message::Answer, Message::NodeStatus] {
            outbox.push(frame(message));
        }
        outbox.start_tick();
        assert_eq!(outbox.dropped(), 2);
        outbox.push(frame(Message::PoseX));
        let left: Vec<_> = core::iter::from_fn(|| outbox.pop())
            .map(|frame| frame.message)
            .collect();
        assert_eq!(left, [Message::PoseX, Message::Answer]);
    }
}
