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
/// date. Answers are sent only once and wait as long as it takes: an answer that is taken back for a pose goes again.
#[derive(Debug, Default)]
pub struct Outbox {
    /// Frames of this tick; true: it may join the previous frame in the mailboxes.
    fresh: Deque<(Coded, bool), FRESH_MAX>,
    lasting: Deque<Coded, LASTING_MAX>,
    /// Whether the first of them is in a mailbox.
    answers: bool,
    /// Frames that were never sent. Saturates.
    pub dropped: u32,
}

impl Outbox {
    /// Adds a frame at the end. Only an answer is still worth sending after its tick.
    pub fn push(&mut self, frame: Coded) {
        let full = match frame.message {
            Message::Answer => self.lasting.push_back(frame).is_err(),
            _ => self.fresh.push_back((frame, false)).is_err(),
        };
        self.count_dropped(u32::from(full));
    }

    /// Adds a group at the end: up to three frames of this tick with rising identifiers.
    pub fn push_group(&mut self, frames: impl Iterator<Item = Coded>) {
        for (frame, joins) in frames.zip([false, true, true]) {
            let full = self.fresh.push_back((frame, joins)).is_err();
            self.count_dropped(u32::from(full));
        }
    }

    /// The next frame for a mailbox, if one may be filled now; it stays until [`Self::filled`]. `all_empty`: no mailbox holds
    /// a frame.
    pub fn front(&self, all_empty: bool) -> Option<&Coded> {
        match self.fresh.front() {
            Some((frame, joins)) => (all_empty || *joins).then_some(frame),
            None => self.lasting.front().filter(|_| all_empty && !self.answers),
        }
    }

    /// Whether no frame waits.
    pub fn is_empty(&self) -> bool {
        self.fresh.is_empty() && self.lasting.is_empty()
    }

    /// The frame that [`Self::front`] gave is in a mailbox.
    pub fn filled(&mut self) {
        self.answers = self.fresh.pop_front().is_none();
    }

    /// Takes the frame that [`Self::front`] gives to empty mailboxes, for a bus that always sends it.
    pub fn pop(&mut self) -> Option<Coded> {
        let frame = self.front(true).copied()?;
        self.filled();
        self.completed(true);
        Some(frame)
    }

    /// A mailbox has sent its frame, or given it up.
    pub fn completed(&mut self, is_sent: bool) {
        match (core::mem::take(&mut self.answers), is_sent) {
            (true, true) => drop(self.lasting.pop_front()),
            (true, false) => {}
            (false, _) => self.count_dropped(u32::from(!is_sent)),
        }
    }

    /// Discards the frames of the previous tick that are out of date.
    pub fn start_tick(&mut self) {
        self.count_dropped(self.fresh.len() as u32);
        self.fresh.clear();
    }

    const fn count_dropped(&mut self, frames: u32) {
        self.dropped = self.dropped.saturating_add(frames);
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;

    const fn frame(message: Message) -> Coded {
        Coded {
            message,
            bytes: [0; 8],
        }
    }

    #[test]
    fn frames_left_over_and_frames_too_many_are_counted() {
        let mut outbox = Outbox::default();
        (0..FRESH_MAX + 2).for_each(|_| outbox.push(frame(Message::PoseX)));
        assert_eq!(outbox.dropped, 2);
        assert_eq!(outbox.pop(), Some(frame(Message::PoseX)));
        outbox.start_tick();
        assert_eq!(outbox.dropped, 2 + FRESH_MAX as u32 - 1);
        assert_eq!(outbox.front(true), None);
    }

    #[test]
    fn an_answer_gives_way_to_the_next_pose_and_goes_again_until_it_is_sent() {
        let mut outbox = Outbox::default();
        let next = |outbox: &mut Outbox, is_sent| {
            let message = outbox.front(true).map(|frame| frame.message);
            if message.is_some() {
                outbox.filled();
                assert_eq!(outbox.front(false), None);
                outbox.completed(is_sent);
            }
            message
        };
        for message in [Message::PoseX, Message::Answer, Message::NodeStatus] {
            outbox.push(frame(message));
        }
        outbox.start_tick();
        assert_eq!(next(&mut outbox, false), Some(Message::Answer));
        outbox.push(frame(Message::PoseX));
        assert_eq!(next(&mut outbox, true), Some(Message::PoseX));
        assert_eq!(next(&mut outbox, true), Some(Message::Answer));
        assert_eq!(next(&mut outbox, true), None);
        assert!(outbox.is_empty());
        assert_eq!(outbox.dropped, 2);
    }
}
