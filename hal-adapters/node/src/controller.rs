//! The whole controller around its chip: the start, and the two halves of a tick.

use crate::acquisition::Acquisition;
use crate::board::Board;
use crate::bus::{Bus, Can};
use crate::constants::Constants;
use crate::fpu;
use crate::node::{Facts, Node, Parameters, SampleFault, Settings};
use crate::records::Records;
use crate::retained::{FaultKind, Retained, Step};
use crate::schedule::{Schedule, Tick};
use crate::start_up::Before;
use crate::store::Slots;
use crate::telemetry::STAGE;
use embedded_storage::nor_flash::MultiwriteNorFlash;
use hal_adapters::adc::FrameSampler;
use hal_adapters::can::Layout;
use hal_adapters::can::status::{BoardFacts, board_check};
use hal_adapters::can::update::Store;
use runtime::{PlanarPose, Status};

/// Longest wait of a reset or an erase for the answers to leave, ms.
const SILENCE_MS: u32 = 200;

/// The hardware, set up.
#[derive(Debug)]
pub struct Parts<A, C, F, B> {
    /// The converter, not started yet.
    pub converter: A,
    /// The CAN controller.
    pub can: C,
    /// The parameter slots.
    pub slots: Slots<F>,
    /// All else.
    pub board: B,
}

/// A controller that ticks.
pub struct Controller<'s, A: FrameSampler, C, F, B> {
    /// The board.
    pub board: B,
    /// The CAN bus.
    pub bus: Bus<C>,
    schedule: Schedule,
    /// The tick while its codes settle.
    open: Option<Tick>,
    acquisition: Acquisition<A>,
    /// The node.
    pub node: Node<'s>,
    facts: Facts,
    /// The zero deviation in the retained record.
    zero: PlanarPose<f32>,
    /// The parameters in flash.
    pub records: Records<F>,
    constants: Constants,
    silence_ticks_max: u32,
    /// Ticks that a reset or an erase has waited for the answers to leave.
    silence_ticks: u32,
    proven_ticks: u32,
    overrun_ticks: u32,
}

impl<'s, A: FrameSampler, C: Can, F: MultiwriteNorFlash, B: Board> Controller<'s, A, C, F, B> {
    /// Loads the parameters and starts the converter. `facts` are the findings of the start-up until now.
    pub fn start(
        parts: Parts<A, C, F, B>,
        settings: Settings<'s>,
        before: &Before,
        facts: BoardFacts,
    ) -> Self {
        let (mut board, period) = (parts.board, settings.period);
        board.feed_watchdog();
        board.record().begin(Step::Parameters);
        let (mut records, refusal) =
            Records::start(parts.slots, before.choice, settings.identity.serial);
        // After a warm start the FPU may have any settings. These give the host's arithmetic.
        fpu::restore();
        let is_sound = runtime::arithmetic::check().is_ok() && fpu::defaults_are_sound();
        // Without sound arithmetic no blob runs.
        let decoder = match is_sound {
            true => records.load(before.choice),
            false => None,
        };
        let blob = records.running().map_or(0, |running| running.id.crc);
        let stop = before.stop(decoder.is_some());
        let parameters = Parameters::at_start(decoder, refusal, stop, is_sound);
        let layout = Layout::from_bits(A::CODE_BITS);
        let mut node = Node::new(parameters, before.by_fault, layout, settings);
        let zero_lost = before.restore_zero(&mut node, blob);
        let zero = node.zero();
        // Without a running blob the record stays for a later start.
        if node.decoder().is_some() {
            board.record().update(|record| record.runs(blob, zero));
        }
        let mut facts = Facts {
            board: facts,
            ..Facts::default()
        };
        facts.note(board_check::ZERO_LOST, zero_lost);

        board.feed_watchdog();
        board.record().begin(Step::Converter);
        let mut acquisition = Acquisition::new(parts.converter, period);
        // The ticks report a failure and start it again.
        let _ = acquisition.start();

        let schedule = Schedule::starting(board.now_us(), period);
        board.feed_watchdog();
        board.record().begin(Step::Ticking);
        Self {
            board,
            bus: Bus::new(parts.can, period),
            schedule,
            open: None,
            acquisition,
            node,
            facts,
            zero,
            records,
            constants: Constants::default(),
            silence_ticks_max: period.ticks_in_ms(SILENCE_MS),
            silence_ticks: 0,
            proven_ticks: period.ticks_per_s(),
            overrun_ticks: 0,
        }
    }

    /// When the next tick is due, us of the clock.
    pub const fn due_us(&self) -> u32 {
        self.schedule.due_us()
    }

    /// The next half of a tick: triggers the converter, or, once its codes have settled, does the rest. Returns when the
    /// next half is due, us of the clock.
    pub fn turn(&mut self) -> u32 {
        if let Some(tick) = self.open.take() {
            self.finish(tick);
            return self.due_us();
        }
        let tick = self.schedule.start_tick(self.board.now_us());
        self.acquisition.trigger();
        self.open = Some(tick);
        tick.started_us.wrapping_add(A::SETTLE_US)
    }

    fn finish(&mut self, tick: Tick) {
        let sample = self.acquisition.sample(tick.sequence);
        self.bus.start_tick();
        // Its announcement has left, or nobody listens.
        let is_silent = self.bus.is_idle() || self.silence_ticks > self.silence_ticks_max;
        let waits = self.node.wants_reset() || self.node.is_storing();
        self.silence_ticks = if waits { self.silence_ticks + 1 } else { 0 };
        if self.node.wants_reset() && is_silent {
            self.board.record().update(Retained::activate);
            self.board.reset();
            return;
        }
        self.note_facts();
        let sample = sample.map_err(SampleFault::from);
        let reading = (self.node).tick(sample, &self.facts, &mut self.bus.outbox);
        let is_missing = reading.status.any(Status::TEMPERATURE_MISSING);
        (self.facts).note(board_check::TEMPERATURE_MISSING, is_missing);
        // After the pose: its frames find the mailboxes empty.
        (self.bus).receive(&mut self.node, &mut self.records, &mut self.board);
        self.bus.send();
        self.retain();
        self.board.light(self.node.light());
        if waits && is_silent {
            // A sector is erased, and the core stands meanwhile.
            self.board.expect_erase(true);
            (self.node).store(&mut self.bus.outbox, &mut self.records);
            self.board.expect_erase(false);
        }
        self.bus.send();

        let counters = [
            self.overrun_ticks,
            self.acquisition.faults,
            self.acquisition.starts,
            self.bus.sent,
            self.bus.outbox.dropped,
            self.bus.overruns,
            self.node.fpu_restored,
        ];
        STAGE.put(tick.sequence, tick.started_us, &reading, counters);
        if self.schedule.is_kept(&tick, self.board.now_us()) {
            self.board.feed_watchdog();
        } else {
            self.overrun_ticks = self.overrun_ticks.saturating_add(1);
        }
    }

    /// A mailbox has become empty: the next frame.
    pub fn mailbox_empty(&mut self) {
        self.bus.send();
    }

    fn note_facts(&mut self) {
        let facts = &mut self.facts;
        facts.missed_ticks = self.schedule.missed;
        facts.bus_off = self.bus.bus_off;
        facts.servo_off_pin = self.board.servo_is_off();
        let is_low = (self.records.slots.supply_is_low)();
        facts.note(board_check::SUPPLY_LOW, is_low);
        facts.note(board_check::CAN_NOT_STARTED, !self.bus.takes_part());
    }

    /// Notes what the next start needs to know, and resets if the decoder has changed.
    fn retain(&mut self) {
        let decoder = self.node.decoder();
        if !decoder.is_none_or(|decoder| self.constants.are_sound(decoder)) {
            let note = |record: &mut Retained| record.note(FaultKind::Constants, 0, 0);
            self.board.record().update(note);
            self.board.reset();
        }
        let zero = self.node.zero();
        if self.zero != zero {
            self.zero = zero;
            self.board.record().update(|record| record.zero = zero);
        }
        if self.node.ticks == self.proven_ticks {
            self.board.record().update(Retained::prove);
        }
    }
}
