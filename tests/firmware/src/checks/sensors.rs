//! Faults of converters, wires and sensors: told, survived, and gone when they end. Each prints
//! a row of a table: after how many ticks it is told, and how many valid poses were wrong.

use super::{Outcome, equal, expect};
use crate::adc_model::{Adc, AdcFault, Part};
use crate::bench::{Axis, Bench, Comparison, Seen, Words};
use crate::machine::Machine;
use hal_adapters::adc::ads8688::REFERENCE_US;
use hal_adapters::adc::stuck::{GAP_PERIODS, HALL_PERIODS};
use hal_adapters::can::status::NodeState;
use runtime::Status;

const TICK_NS: u64 = 2_000_000;
/// Ticks before a fault begins.
const BEFORE: u64 = 100;
/// Ticks that a fault lasts, unless it is over at once.
const LASTS: u64 = 300;
/// The converter is started again after so many ticks without codes.
const RESTART: u64 = 16;

/// What happens to a converter.
#[derive(Clone, Copy)]
enum Event {
    Fault(AdcFault),
    /// Bits of a register change by themselves.
    Flip {
        register: u8,
        bits: u16,
    },
    PowerLoss,
}

impl Event {
    fn happen(self, adc: &mut Adc, now_ns: u64) {
        match self {
            Self::Fault(fault) => adc.fault = fault,
            Self::Flip { register, bits } => adc.flip(register, bits, now_ns),
            Self::PowerLoss => adc.power_up(now_ns),
        }
    }
}

/// How long a fault lasts.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Lasts {
    /// Until it is taken away.
    Long,
    /// One tick.
    OneTick,
    /// It is over at once, and what it changed is set right by the next start.
    UntilStarted,
}

/// What a fault must look like from the bus.
pub struct Case {
    name: String,
    event: Event,
    lasts: Lasts,
    /// States and reasons in the status frames, any of these.
    told: Vec<(NodeState, u8)>,
    /// Ticks after which the fault is told at the latest.
    within: u64,
    /// Bits of the pose's status.
    status: Status,
    /// Ticks after which poses must be good again once the fault is gone.
    back_within: u64,
    /// Valid poses that may be wrong.
    wrong: u64,
}

const NOTHING: Status = Status::PLANAR_INVALID.with(Status::VERTICAL_INVALID);

/// Bits that are not compared: out of range, which means nothing of an invalid pose, and missed
/// frames.
const NOT_COMPARED: u32 = Status::VERTICAL_EXTRAPOLATED
    .with(Status::PLANAR_EXTRAPOLATED)
    .with(Status::FRAMES_MISSED)
    .bits();

const SENSORS: [&str; 6] = ["Hall A", "Hall B", "Hall C", "gap 1", "gap 2", "gap 3"];

/// Ticks without codes after a start of the part.
pub const fn ticks_to_settle(part: Part) -> u64 {
    match part {
        Part::Ads131m08 => 0,
        Part::Ads8688 => REFERENCE_US as u64 * 1000 / TICK_NS,
    }
}

impl Case {
    fn of(name: &str, fault: AdcFault, told: &[(NodeState, u8)], part: Part) -> Self {
        Self {
            name: name.to_owned(),
            event: Event::Fault(fault),
            lasts: Lasts::Long,
            told: told.to_vec(),
            within: 1,
            status: NOTHING,
            back_within: 1 + RESTART + ticks_to_settle(part),
            wrong: 0,
        }
    }

    fn of_register(register: u8, bits: u16, name: &str, part: Part) -> Self {
        // A part of which a signature covers the registers tells the wrong input.
        let told = [
            (NodeState::SensorFault, 5),
            (NodeState::SensorFault, 8),
            NOT_READY,
        ];
        Self {
            event: Event::Flip { register, bits },
            lasts: Lasts::UntilStarted,
            ..Self::of(name, AdcFault::None, &told, part)
        }
    }

    /// The name of the case.
    pub fn name(&self) -> &str {
        &self.name
    }
}

const NOT_READY: (NodeState, u8) = (NodeState::NoFrames, 7);
const SILENT: (NodeState, u8) = (NodeState::NoFrames, 3);

/// Every fault of a part.
pub fn cases(part: Part) -> Vec<Case> {
    let fault = |reason| (NodeState::SensorFault, reason);
    let frozen = |k: usize| {
        let periods = if k < 3 { HALL_PERIODS } else { GAP_PERIODS };
        (0x20 + k as u8, u64::from(periods))
    };
    let mut all = vec![
        Case::of("data line low", AdcFault::Line(0x00), &[SILENT], part),
        Case::of("data line high", AdcFault::Line(0xff), &[SILENT], part),
        Case::of("chip select cut", AdcFault::Select, &[SILENT], part),
        Case {
            lasts: Lasts::OneTick,
            back_within: 1,
            ..Case::of("frames of one tick lost", AdcFault::Select, &[SILENT], part)
        },
    ];
    // A start fails, too, and is followed by a reset that lasts a tick.
    let flipped = match part {
        Part::Ads131m08 => [fault(6), fault(5), SILENT],
        Part::Ads8688 => [fault(8), fault(4), NOT_READY],
    };
    let name = "a flipped bit in every frame";
    all.push(Case::of(name, AdcFault::FlippedBit, &flipped, part));
    let (reason, periods) = frozen(0);
    all.push(Case {
        within: periods,
        wrong: periods - 1,
        back_within: 1 + ticks_to_settle(part),
        ..Case::of(
            "all codes frozen",
            AdcFault::Stuck,
            &[fault(reason), NOT_READY],
            part,
        )
    });
    for (k, sensor) in SENSORS.iter().enumerate() {
        let (reason, periods) = frozen(k);
        let name = format!("{sensor} frozen");
        all.push(Case {
            within: periods,
            wrong: periods - 1,
            back_within: 1 + ticks_to_settle(part),
            ..Case::of(
                &name,
                AdcFault::Frozen(k),
                &[fault(reason), NOT_READY],
                part,
            )
        });
        let name = format!("{sensor} open, at its rail");
        let lost = if k < 3 {
            Status::PLANAR_INVALID
        } else {
            NOTHING
        };
        let told = [fault(0x10 + k as u8)];
        all.push(Case {
            status: Status::from_bits(1 << k).with(lost),
            back_within: 1,
            ..Case::of(&name, AdcFault::Rail(k), &told, part)
        });
    }
    all.push(Case {
        event: Event::PowerLoss,
        lasts: Lasts::UntilStarted,
        told: vec![fault(5), fault(8), NOT_READY],
        ..Case::of("a short loss of power", AdcFault::None, &[], part)
    });
    match part {
        Part::Ads131m08 => {
            let told = [fault(10), fault(5)];
            all.push(Case {
                within: 2,
                back_within: 1 + RESTART,
                ..Case::of("SYNC cut", AdcFault::Control, &told, part)
            });
            let told = [NOT_READY, fault(5)];
            all.push(Case::of("CLKIN stops", AdcFault::Clock, &told, part));
            for (register, bits, name) in [
                (0x03, 1 << 2, "a bit of CLOCK flips"),
                (0x04, 1 << 12, "a bit of GAIN1 flips"),
                (0x1b, 1, "a bit of CH3_GCAL_MSB flips"),
            ] {
                all.push(Case::of_register(register, bits, name, part));
            }
        }
        Part::Ads8688 => {
            for (register, bits, name) in [
                (0x01, 1 << 2, "a bit of AUTO_SEQ_EN flips"),
                (0x02, 1 << 3, "a bit of Channel Power Down flips"),
                (0x03, 2, "a bit of Feature Select flips"),
                (0x05, 1, "bit 0 of a range flips"),
                (0x0a, 2, "bit 1 of a range flips"),
            ] {
                all.push(Case::of_register(register, bits, name, part));
            }
            // It changes nothing yet, and is found when its register is read back.
            all.push(Case {
                within: 11,
                back_within: 12 + ticks_to_settle(part),
                ..Case::of_register(0x0c, 1, "the range of an unused input flips", part)
            });
        }
    }
    all
}

/// Runs to the middle between two ticks; tick `from` is the next one.
fn run_to(machine: &mut Machine, from: u64) -> Outcome {
    // The first tick comes a period after the start.
    machine.run_ticks(u64::from(machine.chip.first_tick_ns.is_none()) * 2)?;
    let first_ns = machine.chip.first_tick_ns.ok_or("no tick")?;
    let until_ns = first_ns + from * TICK_NS - TICK_NS / 2;
    machine.run_ns(until_ns.saturating_sub(machine.chip.now_ns))?;
    Ok(())
}

/// The planar words of valid poses that differ from the host's.
fn wrong_poses(axes: &[Axis], poses: &[Words]) -> u64 {
    let mut ticks: Vec<_> = axes
        .iter()
        .filter(|axis| axis.status & Status::PLANAR_INVALID.bits() == 0)
        .filter(|axis| poses[axis.tick as usize % poses.len()].words[axis.axis] != axis.word)
        .map(|axis| axis.tick)
        .collect();
    ticks.dedup();
    ticks.len() as u64
}

/// A fault that comes and goes.
pub fn survives(bench: &Bench, part: Part, case: &Case) -> Outcome {
    let mut machine = bench.machine(part, [&bench.blob, &[]])?;
    run_to(&mut machine, BEFORE)?;
    let before = Seen::since_last(&mut machine);
    let mut good = Comparison::default();
    good.add(&before.axes, &bench.poses, ticks_to_settle(part));
    equal("words that differ before", good.differing, 0)?;
    expect(good.planar > 80, || {
        format!("only {} poses before", good.planar)
    })?;

    let now_ns = machine.chip.now_ns;
    case.event.happen(&mut machine.chip.adc, now_ns);
    let lasts = match case.lasts {
        Lasts::Long => LASTS,
        Lasts::OneTick | Lasts::UntilStarted => 1,
    };
    run_to(&mut machine, BEFORE + lasts)?;
    machine.chip.adc.fault = AdcFault::None;
    let during = Seen::since_last(&mut machine);
    let end = BEFORE + LASTS;
    run_to(&mut machine, end + LASTS)?;
    let after = Seen::since_last(&mut machine);

    let mut axes = during.axes;
    axes.extend(&after.axes);
    let planar = |axis: &&Axis| axis.axis < 3;
    let told = axes
        .iter()
        .filter(planar)
        .find(|axis| axis.status & Status::PLANAR_INVALID.bits() != 0)
        .map(|axis| axis.tick + 1 - BEFORE);
    let wrong = wrong_poses(&axes, &bench.poses);
    let text = told.map_or("never".to_owned(), |ticks| ticks.to_string());
    println!("FAULT   {part:?} | {} | {text} | {wrong}", case.name);
    expect(told.is_some_and(|ticks| ticks <= case.within), || {
        format!("told after {text} ticks, not {}", case.within)
    })?;
    expect(wrong <= case.wrong, || format!("{wrong} wrong valid poses"))?;

    if case.lasts == Lasts::Long {
        let late = |tick: u64| (BEFORE + case.within..end).contains(&tick);
        let shown: Vec<_> = axes.iter().filter(|axis| late(axis.tick)).collect();
        expect(shown.len() > 800, || format!("only {} words", shown.len()))?;
        let other = shown.into_iter().filter(planar).find(|axis| {
            let status = axis.status & !NOT_COMPARED;
            axis.word != 0 || status != case.status.bits() && status != NOTHING.bits()
        });
        let other = other.map(|axis| (axis.tick, axis.word, axis.status));
        equal("a planar word during the fault", other, None)?;
        let statuses = during.statuses.iter().filter(|(tick, _)| late(*tick));
        expect(statuses.clone().count() >= 12, || "few states".to_owned())?;
        for (tick, status) in statuses {
            let found = (status.state, status.reason);
            let known = case.told.iter().any(|(s, r)| found == (Some(*s), *r));
            expect(known, || format!("{found:?} at tick {tick}"))?;
        }
    }

    let gone = if case.lasts == Lasts::Long {
        end
    } else {
        BEFORE + 1
    };
    let mut good = Comparison::default();
    // The first good frame tells that frames were missed before it; then all is as before.
    good.add(&axes, &bench.poses, gone + 1 + case.back_within);
    equal("words that differ after", good.differing, 0)?;
    expect(good.planar > 200, || {
        format!("only {} poses after", good.planar)
    })?;
    let state = after.last_status().and_then(|status| status.state);
    equal("state after", state, Some(NodeState::Running))?;
    let damaged = before.damaged + during.damaged + after.damaged;
    equal("damaged frames", damaged, 0)?;
    let resets = (machine.panics, machine.watchdog_resets);
    equal("panics and watchdog resets", resets, (0, 0))
}

/// A converter that does not answer when the controller starts, and does later; one whose supply
/// comes later.
pub fn dead_from_the_start(bench: &Bench, part: Part) -> Outcome {
    for late_supply in [false, true] {
        let mut machine = bench.machine(part, [&bench.blob, &[]])?;
        machine.chip.adc.fault = AdcFault::Line(0xff);
        run_to(&mut machine, 200)?;
        let seen = Seen::since_last(&mut machine);
        let state = seen.last_status().and_then(|status| status.state);
        equal("state", state, Some(NodeState::NoFrames))?;
        machine.chip.adc.fault = AdcFault::None;
        if late_supply {
            let now_ns = machine.chip.now_ns;
            machine.chip.adc.power_up(now_ns);
        }
        run_to(&mut machine, 400)?;
        let seen = Seen::since_last(&mut machine);
        equal("wrong poses", wrong_poses(&seen.axes, &bench.poses), 0)?;
        let mut good = Comparison::default();
        let first = 200 + 2 * RESTART + ticks_to_settle(part);
        good.add(&seen.axes, &bench.poses, first);
        equal("words that differ", good.differing, 0)?;
        expect(good.planar >= 150, || format!("only {} poses", good.planar))?;
        let state = seen.last_status().and_then(|status| status.state);
        equal("state", state, Some(NodeState::Running))?;
        let resets = (machine.panics, machine.watchdog_resets);
        equal("panics and watchdog resets", resets, (0, 0))?;
    }
    Ok(())
}

/// A register of the ADS131M08 that changes at any time of a period is told two ticks later at the
/// latest: what changes while codes settle can be flagged after they are read.
pub fn a_register_changes_at_any_time(bench: &Bench) -> Outcome {
    for offset_ns in (0..TICK_NS).step_by(50_000) {
        let mut machine = bench.machine(Part::Ads131m08, [&bench.blob, &[]])?;
        run_to(&mut machine, BEFORE)?;
        machine.run_ns(TICK_NS / 2 + offset_ns)?;
        let now_ns = machine.chip.now_ns;
        machine.chip.adc.flip(0x04, 1, now_ns);
        Seen::since_last(&mut machine);
        run_to(&mut machine, BEFORE + 4)?;
        let seen = Seen::since_last(&mut machine);
        let told = seen.axes.iter().any(|axis| {
            axis.tick <= BEFORE + 1 && axis.status & Status::PLANAR_INVALID.bits() != 0
        });
        expect(told, || format!("not told: {offset_ns} ns after a trigger"))?;
    }
    Ok(())
}

/// The host's words whichever way the ADS131M08 goes where its sheet is silent, at the SPI's
/// fastest and at a slow one.
pub fn every_variant(bench: &Bench) -> Outcome {
    const TICKS: u64 = 2000;
    let mut words = 0;
    for variant in crate::adc_model::ads131m08::Variant::all() {
        for spi_byte_ns in [762, 1000, 1800] {
            let mut machine = bench.machine(Part::Ads131m08, [&bench.blob, &[]])?;
            machine.chip.adc.set_variant(variant);
            machine.chip.spi_byte_ns = Some(spi_byte_ns);
            machine.run_ticks(TICKS)?;
            let seen = Seen::since_last(&mut machine);
            let mut good = Comparison::default();
            good.add(&seen.axes, &bench.poses, 0);
            equal(
                &format!("words that differ: {variant:?}, {spi_byte_ns} ns a byte"),
                good.differing,
                0,
            )?;
            expect(good.planar >= TICKS - 2, || {
                format!("only {} poses: {variant:?}", good.planar)
            })?;
            words += good.words;
        }
    }
    println!("RESULT firmware_variants_words={words}");
    Ok(())
}
