//! A node that takes new parameters over the bus: the adapters' own code, with a store in RAM.

use hal_adapters::can::command::Told;
use hal_adapters::can::service::Updates;
use hal_adapters::can::status::{NodeState, NodeStatus};
use hal_adapters::can::update::{Identity, Key, MemoryStore, Receiver};
use hal_adapters::can::{BusFrame, Coded, Service};
use hal_adapters::fault::Random;
use runtime::BlobError;

/// Ticks of a second.
pub const TICKS_PER_S: u32 = 500;

/// A controller, as far as its parameters are concerned.
pub struct Node {
    serial: &'static str,
    key: Option<Key>,
    service: Service,
    receiver: Receiver<'static>,
    /// What it keeps over a reset.
    pub store: MemoryStore,
    /// Stands for the random number generator of a controller.
    random: Random,
    resets: u32,
}

fn receiver(serial: &'static str, key: Option<Key>) -> Receiver<'static> {
    let identity = Identity {
        serial: Some(serial),
        key,
        program_version: 0x00_01_02_03,
        program_hash: 0xfeed_beef,
    };
    Receiver::new(identity, TICKS_PER_S)
}

impl Node {
    /// A node of the stage `serial` that runs a blob, as record `sequence`.
    ///
    /// # Errors
    /// The blob is not sound.
    pub fn new(
        serial: &'static str,
        key: Option<Key>,
        (sequence, blob): (u32, &[u8]),
        seed: u64,
    ) -> Result<Self, BlobError> {
        Ok(Self {
            serial,
            key,
            service: Service::new(TICKS_PER_S),
            receiver: receiver(serial, key),
            store: MemoryStore::holding(sequence, blob)?,
            random: Random::new(seed),
            resets: 0,
        })
    }

    /// Takes a frame of the bus; gives the answer.
    pub fn take(&mut self, frame: &BusFrame) -> Option<Coded> {
        let nonce = [(); 4].map(|()| self.random.bits() as u32);
        let updates = Updates {
            receiver: &mut self.receiver,
            store: &mut self.store,
            nonce: Some(nonce),
        };
        let taken = self.service.take_updating(frame, None, Some(updates))?;
        taken.ok()?.answer
    }

    /// One tick; gives the answer to a request that has ended.
    pub fn tick(&mut self) -> Option<Coded> {
        // There is no servo, whose re-zero could end.
        self.service.before_tick(None, None);
        let _ = self.service.tick(None);
        let servo_is_off = self.service.servo_is_off();
        let answer = self.receiver.tick(servo_is_off, &mut self.store)?;
        self.service.tell(&Told::Answer(answer))
    }

    /// The frame with its state.
    pub fn status(&mut self) -> Option<Coded> {
        let state = if self.receiver.is_updating() {
            NodeState::Updating
        } else {
            NodeState::Running
        };
        self.service.tell(&Told::Status(NodeStatus {
            state: Some(state),
            reason: 0,
            flags: self.service.flags(None),
            missed_ticks: 0,
            bus_off: 0,
            version: hal_adapters::can::PROTOCOL_VERSION,
        }))
    }

    /// Whether a transfer is open.
    pub const fn is_updating(&self) -> bool {
        self.receiver.is_updating()
    }

    /// Whether it asked to be reset.
    pub const fn wants_reset(&self) -> bool {
        self.receiver.wants_reset()
    }

    /// A reset: only the store is kept.
    pub fn reset(&mut self) {
        self.store.reset();
        self.service = Service::new(TICKS_PER_S);
        self.receiver = receiver(self.serial, self.key);
        self.resets += 1;
    }

    /// Resets so far.
    pub const fn resets(&self) -> u32 {
        self.resets
    }
}
