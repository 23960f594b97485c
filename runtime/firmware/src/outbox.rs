//! Frames that wait for a mailbox of the CAN controller.

use hal_adapters::can::Coded;
use heapless::Deque;

/// Frames of one tick at most: six of a pose, status or health, an answer and a page.
pub const CAPACITY: usize = 12;

/// A queue for the frames of one tick. Frames that were not sent before the next tick are out of
/// date: they are discarded and counted.
#[derive(Debug, Default)]
pub struct Outbox {
    queue: Deque<Coded, CAPACITY>,
    dropped: u32,
}

impl Outbox {
    /// An empty box.
    pub const fn new() -> Self {
        Self {
            queue: Deque::new(),
            dropped: 0,
        }
    }

    /// Adds a frame at the end.
    pub fn push(&mut self, frame: Coded) {
        if self.queue.push_back(frame).is_err() {
            self.count_dropped(1);
        }
    }

    /// The frame to be sent next; it stays until [`Self::pop`].
    pub fn front(&self) -> Option<&Coded> {
        self.queue.front()
    }

    /// Removes the first frame.
    pub fn pop(&mut self) -> Option<Coded> {
        self.queue.pop_front()
    }

    /// Discards what is left of the previous tick.
    pub fn start_tick(&mut self) {
        self.count_dropped(self.queue.len() as u32);
        self.queue.clear();
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
    use super::*;
    use hal_adapters::can::Message;

    const FRAME: Coded = Coded {
        message: Message::PoseX,
        bytes: [0; 8],
    };

    #[test]
    fn frames_left_over_and_frames_too_many_are_counted() {
        let mut outbox = Outbox::new();
        (0..CAPACITY + 2).for_each(|_| outbox.push(FRAME));
        assert_eq!(outbox.dropped(), 2);
        assert_eq!(outbox.pop(), Some(FRAME));
        outbox.start_tick();
        assert_eq!(outbox.dropped(), 2 + CAPACITY as u32 - 1);
        assert_eq!(outbox.front(), None);
    }
}
