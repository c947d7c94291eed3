//! The exec task: keeps the segment ring full. The only task of the exec executor.
//!
//! Reads the block ring, writes the segment ring, waits for a free segment slot, a new block, or the
//! steppers to stop (each pends the exec interrupt). One run prepares what is needed for the next few
//! milliseconds ([`Amount::least`]), 4,000 to 12,000 cycles each, 24,000 at worst; the rest one by one, when one is used up or thread mode
//! has nothing else to do: a line that has come is answered meanwhile. When too little waits ([`WAITING_SHORT`]), stretches become twice
//! as long, and for a while more waits ([`PRESSED`]).

use avr_embassy::InterruptEnd;

use crate::dda::contact;
use crate::dda::{SEGMENTS, Segment};
use crate::encoder::Encoder;
use crate::hal::Interrupt;
use crate::hal::arithmetic::product;
use crate::hal::event::{self, Event};
use crate::hal::ring::{Prefilled, Producer};
use crate::hal::{TIMER_HZ, encoder as sensors, exec, flags, stepper, uart};
use crate::machine::{self, Alarm};
use crate::motion::exec::{Exec, Step, take_heat, take_override};
use crate::motion::finished::Finished;
use crate::motion::queue::BlockSource;
use crate::motion::snapshot::{Program, Snapshot};
use crate::motion::thread::Thread;
use crate::tasks::health::{self, Sign};
use kerf_macros::small;

use crate::capability::Capability;
use crate::motors::Motors;
use crate::spindle::Spindle;
use crate::status::Status;
use crate::tasks::common::{Common, State};
use crate::tasks::{Never, hold, links, overrides, power, spindle};

/// After so many segments without a turn of thread mode they become longer, which takes less of the CPU.
const PATIENCE: u8 = 6;

/// After so many, while somebody asks, a jerk-limited motion makes no scans that may wait.
const PATIENCE_ASKED: u8 = 1;

/// While motion has just begun thread mode gets a turn after so many segments: what waits is built up from
/// nothing, which would take 6 ms at a stretch.
const FIRST_TURN: u8 = 2;

/// The task.
#[allow(clippy::manual_async_fn)] // See `tasks`.
pub fn run(
    level: Interrupt,
    common: InterruptEnd<Common>,
    blocks: BlockSource,
    segments: Producer<Segment, SEGMENTS>,
) -> impl Future<Output = Never> {
    async move {
        // By itself: it would be made on the stack, and copied.
        let mut machine = Exec::new();
        let mut task = Task::new(common, blocks, segments, &mut machine);
        loop {
            match exec::wait(level, || task.go_on()).await {
                Next::Idle => exec::pend_when_idle(),
                Next::Room => exec::note_idle(),
                Next::Block | Next::Turn => links::wait_for_block(true),
            }
            exec_asked_again(level).await;
            links::wait_for_block(false);
        }
    }
}

/// From the start of the steppers to their first tick, CPU cycles.
const FIRST_TICK: u32 = 400;

/// What the task goes on with.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Next {
    /// The next turn, as soon as there is room.
    Turn,
    /// The next turn, if there is room: when thread mode is idle, or a segment has been used up.
    Idle,
    /// The next turn, when a segment has been used up.
    Room,
    /// Whatever it is pended for: a block, the steppers at a standstill, the end of a hold.
    Block,
}

/// What the task owns.
struct Runner<'a> {
    waiting: Waiting,
    finished: Finished,
    /// The machine stands still at the end of what has been queued.
    rests: bool,
    /// The reporter is to be told whether thread mode has been idle since the last segment.
    asked: bool,
    segments: Prefilled<Segment, SEGMENTS>,
    blocks: BlockSource,
    machine: &'a mut Exec,
}

/// The runner, with exec's end of what tasks share.
struct Task<'a> {
    runner: Runner<'a>,
    common: InterruptEnd<Common>,
}

impl<'a> Task<'a> {
    /// Out of line: it would be made on the stack, and copied.
    #[inline(never)]
    #[small]
    fn new(
        common: InterruptEnd<Common>,
        blocks: BlockSource,
        segments: Producer<Segment, SEGMENTS>,
        machine: &'a mut Exec,
    ) -> Self {
        let segments = segments.prefilled(Segment::default());
        let (waiting, finished) = (Waiting::new(), Finished::new());
        let (rests, asked) = (true, false);
        let runner = Runner { waiting, finished, rests, asked, segments, blocks, machine };
        Self { runner, common }
    }

    /// Does what there is room for. What the task goes on with, or `None` if it waits for room.
    ///
    /// Out of line: the CPU reaches fields of the runner from a pointer to it, not from one to the future.
    #[inline(never)]
    fn go_on(&mut self) -> Option<Next> {
        let Self { runner, common } = self;
        while let Some(room) = runner.is_due() {
            let next = runner.turn(room, common);
            if next != Next::Turn {
                return Some(next);
            }
        }
        None
    }
}

impl Runner<'_> {
    /// What there is room for, if there is room for a segment, or a stop to be seen to.
    #[inline(always)]
    fn is_due(&mut self) -> Option<Room> {
        health::answer(Sign::Exec);
        self.waiting.update(self.segments.used());
        let room = self.waiting.room();
        let due = room != Room::None || stepper::is_stopped();
        if due && self.asked {
            self.asked = false;
            self.waiting.go_on(exec::was_idle());
        }
        due.then_some(room)
    }

    /// Does the next thing there is to do.
    #[inline(always)]
    fn turn(&mut self, room: Room, common: &mut InterruptEnd<Common>) -> Next {
        uart::stop_late();
        let released = self.blocks.released();
        let rested = self.rests;
        if contact::is_noted() {
            contact::catch_up(&self.segments);
        }
        let standstill = !stepper::running();
        self.machine.set_long(room == Room::Long);
        let step = common.with(|common| self.step(standstill, common));
        if self.blocks.released() != released {
            flags::set(Event::BlockDone);
        }
        match step {
            Step::Segment => {
                let next = self.queued(rested);
                if standstill && let Some(thread) = self.machine.thread() {
                    common.with(|common| start_thread(thread, &common.encoder));
                }
                next
            }
            Step::Held if machine::rested() => Next::Turn,
            Step::Idle | Step::Standstill | Step::Held => Next::Block,
            Step::Again | Step::Leaves | Step::Switched | Step::Override | Step::Heat => Next::Turn,
        }
    }

    /// The next step of the machine, and what follows from it; a segment is put into the ring.
    #[inline(always)]
    fn step(&mut self, standstill: bool, common: &mut State) -> Step {
        let State { motion: out, overrides, motors, spindle, encoder, heat } = common;
        let used = self.segments.used();
        if self.machine.thread().is_some() {
            look_at_spindle(self.machine, encoder);
        }
        if self.machine.is_per_turn() {
            follow_speed(self.machine, encoder, out);
        }
        let has_left = self.machine.has_left();
        if let Some(why) = has_left {
            note_left(encoder, why);
        }
        let left =
            Capability::Lathe.is_built_in() && (has_left.is_some() || encoder.pass == Status::Noop);
        let holds = hold::is_wanted(out.running) || contact::is_noted() || left;
        self.machine.set_hold(holds, out);
        // What has paused in a hold goes on before motion does.
        if out.outputs != spindle::on() {
            if !machine::is_held() {
                spindle.go_on();
            }
            let ms = spindle::switch(spindle, out, false);
            // In the midst of G33.1 the axes go by the encoder.
            if self.machine.thread().is_none() {
                self.machine.wait(ms, out);
            }
        }
        if let Some(line) = self.finished.take(used) {
            out.finished = line;
        }
        let line = out.line;
        let step = self.next_step(standstill, out, motors);
        if out.line != line {
            self.finished.end(line);
        }
        match step {
            Step::Segment => self.finished.queue(),
            Step::Override => {
                let change = take_override(&mut self.blocks);
                overrides::change_in_stream(overrides, change, &mut self.blocks)
            }
            Step::Heat if Capability::Printer.is_built_in() => {
                if let (Some(orders), Some(wanted)) =
                    (heat.first_mut(), take_heat(&mut self.blocks))
                {
                    orders.carry_out(&wanted);
                }
            }
            Step::Idle if standstill => {
                self.finished.rest();
                out.finished = out.line;
            }
            Step::Held => self.held(out, spindle),
            Step::Leaves if Capability::Lathe.is_built_in() => self.lead(out, motors),
            Step::Switched => self.machine.wait(spindle::switch(spindle, out, true), out),
            Step::Again | Step::Leaves | Step::Idle | Step::Standstill | Step::Heat => {}
        }
        // A standstill stays one until a segment leads out of it; velocity is ahead of the segments.
        self.rests = out.velocity.to_bits() == 0 || (self.rests && step != Step::Segment);
        step
    }

    #[inline(always)]
    fn next_step(&mut self, standstill: bool, out: &mut Snapshot, motors: &mut Motors) -> Step {
        if stepper::is_stopped() {
            return Step::Held;
        }
        // There is room: this task alone fills the ring.
        let Some(mut slot) = self.segments.slot() else {
            return Step::Standstill;
        };
        let step = self.machine.step(&mut self.blocks, standstill, out, &mut slot);
        if step == Step::Segment {
            power::segment(motors, slot.moving);
            let cycles = product(slot.ticks, slot.period);
            self.waiting.push(cycles);
            if let Some(thread) = self.machine.thread() {
                thread.queued(cycles, standstill);
            }
            if contact::is_noted() {
                contact::pushed(&slot);
            }
            slot.publish();
        }
        step
    }

    /// The machine stands still in a hold. Drops what is queued if that is wanted.
    #[inline(never)]
    #[small]
    fn held(&mut self, out: &mut Snapshot, spindle: &mut Spindle) {
        spindle::switch(spindle, out, false);
        machine::drop_if_wanted(|| {
            // What has paused stays off. A kill switches off the rest: the end of the program may wait for a door.
            out.outputs = if machine::is_killing() { 0 } else { spindle::on() };
            spindle.go_on();
            spindle::switch(spindle, out, false);
            let held = self.machine.drop_all(&mut self.blocks, out);
            stepper::settle(held, &mut out.target);
            if Capability::Lathe.is_built_in() && machine::is_dropping() {
                self.machine.end_pass();
            }
            self.finished.rest();
            if machine::alarm() >= Alarm::Shutdown {
                out.program = Program::Ready;
            }
        });
    }

    /// X leaves the cut in the segments that wait.
    #[inline(never)]
    #[small]
    fn lead(&mut self, out: &mut Snapshot, motors: &mut Motors) {
        let Self { segments, machine, .. } = self;
        let (leaving, is_backwards) = machine.leaving();
        // A single motor: more would take too long, and begin in segments of their own.
        let motor = match leaving {
            1 => 0,
            2 => 1,
            4 => 2,
            8 => 3,
            _ => return,
        };
        power::segment(motors, leaving);
        let mut back = segments.used();
        while back > 0 {
            back -= 1;
            let Some(waits) = segments.copy_of(back) else { continue };
            let moving = waits.moving | leaving;
            let turned = if is_backwards { leaving } else { 0 };
            let backwards = core::hint::black_box(waits.backwards & !leaving | turned);
            let mode = Segment::mode_of(moving);
            machine.lead((waits.ticks, waits.period), out, |increment| {
                // In two pieces: a step waits for 31 cycles at most. The first moves nothing.
                segments.producer().amend_masked(back, |segment| {
                    (segment.backwards, segment.mode) = (backwards, mode);
                }) && segments.producer().amend_masked(back, |segment| {
                    if let Some(of) = segment.increment.get_mut(motor) {
                        *of = increment;
                    }
                })
            });
        }
    }

    /// A segment is in the ring: the steppers go, or go on.
    #[inline(always)]
    fn queued(&mut self, rested: bool) -> Next {
        let Self { waiting, segments, rests, .. } = self;
        health::moves(waiting.count);
        waiting.update(segments.used());
        let has_jerk = self.machine.has_jerk();
        waiting.fewest = if has_jerk { 2 } else { 1 };
        let short = waiting.is_short(*rests);
        let passed_over = event::pass_over();
        // While somebody asks, a ramp in usual stretches would keep the answer away for 9 ms, and scans of one segment after the
        // other for 14.
        let asked = event::is_asked();
        waiting.coarse = short || asked || passed_over > PATIENCE || waiting.is_busy();
        let scans_too_long = asked && has_jerk && passed_over > PATIENCE_ASKED;
        self.machine.set_coarse(waiting.coarse, short || scans_too_long);
        self.machine.set_tight(has_jerk && waiting.is_tight());
        if !rested {
            health::look_for_starvation();
        }
        stepper::go();
        if !waiting.is_enough(passed_over) {
            return Next::Turn;
        }
        self.asked = true;
        if waiting.room() == Room::None { Next::Room } else { Next::Idle }
    }
}

/// A pass follows what the encoder tells. Out of line: it needs the stack for itself.
#[inline(never)]
#[small]
fn look_at_spindle(exec: &mut Exec, encoder: &mut Encoder) {
    let pulses = sensors::read();
    let velocity = exec.velocity();
    let Some(thread) = exec.thread() else { return };
    if thread.turns_round() {
        encoder.note_turning();
    }
    encoder.sample(&pulses);
    if thread.note(&encoder.of_pass(pulses), encoder) && encoder.tells() {
        encoder.turn_pass();
        thread.mirror();
    }
    if let Some(error) = thread.error(velocity) {
        encoder.note_error(error);
    }
    if encoder.pass == Status::Ok && exec.has_turned() {
        encoder.pass = Status::Noop;
        flags::set(Event::BlockDone);
    }
    let Some(thread) = exec.thread() else { return };
    if let Some(fault) = thread.fault() {
        encoder.pass = fault;
        // The planner waits for it.
        flags::set(Event::BlockDone);
    }
    exec.break_off(machine::is_alarmed() || machine::is_killing());
}

/// The pass has been left, for this reason.
#[inline(never)]
#[small]
fn note_left(encoder: &mut Encoder, why: Status) {
    if encoder.pass == Status::Ok {
        encoder.pass = why;
        flags::set(Event::BlockDone);
    }
}

/// Feeds a turn go by the measured speed, if there is an encoder: S is what they were planned for.
#[inline(never)]
#[small]
fn follow_speed(exec: &mut Exec, encoder: &mut Encoder, out: &Snapshot) {
    let share = match encoder.per_turn() {
        0 => 1.0,
        _ => encoder.feeds() as f32 / (out.speed * 1e3),
    };
    exec.set_share(share);
    if exec.takes_too_long() {
        encoder.pass = Status::SpindleMustTurn;
    }
}

/// The steppers have just been started in a pass.
#[inline(never)]
#[small]
fn start_thread(thread: &mut Thread, encoder: &Encoder) {
    thread.anchor(encoder.time_at(sensors::read().now), FIRST_TICK);
}

/// How long the segments last that wait in the ring, in units of 2^11 CPU cycles.
struct Waiting {
    /// The lengths of the last segments, the newest at `count - 1`, modulo their number.
    lengths: [u8; SEGMENTS],
    /// Segments queued, modulo 256.
    count: u8,
    /// How many wait at least.
    fewest: u8,
    /// Stretches are twice as long, if there is room for them.
    coarse: bool,
    /// How many wait, as far as that is known, and how long they take together.
    used: u8,
    sum: u16,
    /// Segments until the usual amount waits again.
    pressed: u8,
    /// Segments since the machine stood still.
    moved: u8,
    /// How many segments in a row were used up before thread mode was idle.
    busy: u8,
}

/// What there is room for.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Room {
    /// There is none for another segment.
    None,
    /// There is room for one of the usual length.
    Usual,
    /// There is room for one that is twice as long.
    Long,
}

/// After this many of them in a row thread mode has no time left.
const BUSY: u8 = 3;

/// The unit of lengths as a power of two: shifts are cheaper than divisions.
const UNIT_LOG2: u8 = 11;

/// Units in so many tenths of a millisecond.
const fn units(tenths: u32) -> u16 {
    ((TIMER_HZ / 10_000 * tenths) >> UNIT_LOG2) as u16
}

/// How much is handed out, in the unit.
struct Amount {
    /// What may wait, with the segment that runs.
    most: u16,
    /// What is prepared before thread mode gets a turn.
    least: u16,
}

/// A feedhold begins within 10 ms. Less would not outlast a ramp that is laid out while ticks take two thirds of the CPU, which takes up to
/// 4.1 ms, or an override.
const USUAL: Amount = Amount { most: units(88), least: units(42) };

/// For a while after too little has been waiting: more is prepared at a stretch. A feedhold begins within 10 ms still.
const PRESSED: Amount = Amount { most: units(94), least: units(65) };

/// How long [`PRESSED`] is in force, in segments.
const PRESSED_FOR: u8 = 100;

/// With less than this exec is late, and makes longer stretches.
const WAITING_SHORT: u16 = units(25);

/// With less than this an acceleration that is about to end under a jerk limit ends, the rest of the segment that runs counted in.
const TIGHT: u16 = units(58);

/// With less than this another segment may wait in any case.
const SOON: u16 = units(20);

/// A segment that takes so long may wait alone, except under a jerk limit, where a ramp takes long to lay out.
const LONG: u16 = units(30);

/// What a stretch takes, if it is no end of a block.
const USUAL_LENGTH: u16 = units(20);
/// What a stretch takes at most while thread mode is busy.
const COARSE: u16 = units(40);

/// What waits at least when thread mode gets a turn while motion has just begun: exec takes that long for a
/// segment at worst.
const FIRST_LEAST: u16 = units(15);

impl Waiting {
    const fn new() -> Self {
        Self {
            lengths: [0; SEGMENTS],
            count: 0,
            fewest: 2,
            coarse: false,
            used: 0,
            sum: 0,
            pressed: 0,
            moved: 0,
            busy: 0,
        }
    }

    /// The length of the segment that was queued so many before the next one.
    #[inline(always)]
    fn length(&self, back: u8) -> u16 {
        let at = usize::from(self.count.wrapping_sub(back)) % SEGMENTS;
        self.lengths.get(at).copied().unwrap_or_default().into()
    }

    /// A segment of so many CPU cycles has been queued.
    #[inline(always)]
    fn push(&mut self, cycles: u32) {
        let units = (cycles >> 8) as u16 >> (UNIT_LOG2 - 8);
        let length = if cycles >> 24 != 0 || units > 0xFF { 0xFF } else { units as u8 };
        if let Some(place) = self.lengths.get_mut(usize::from(self.count) % SEGMENTS) {
            *place = length;
        }
        self.count = self.count.wrapping_add(1);
        self.pressed = self.pressed.saturating_sub(1);
        self.used = self.used.wrapping_add(1);
        self.sum += u16::from(length);
    }

    /// No more than `used` segments wait.
    #[inline(always)]
    fn update(&mut self, used: usize) {
        while self.used > used as u8 {
            self.sum -= self.length(self.used);
            self.used -= 1;
        }
    }

    /// Exec goes on: thread mode was `idle` meanwhile, or a segment was used up before.
    fn go_on(&mut self, idle: bool) {
        self.busy = if idle { 0 } else { self.busy.saturating_add(1) };
    }

    /// Whether thread mode has no time left: then stretches are longer, which leaves it more.
    fn is_busy(&self) -> bool {
        self.busy >= BUSY
    }

    /// Whether enough waits, and thread mode is asked for something: it gets the CPU then until less does.
    #[inline(always)]
    fn gives_way(&self) -> bool {
        event::is_asked() && self.sum >= USUAL.least
    }

    fn limits(&self) -> &'static Amount {
        if self.pressed > 0 { &PRESSED } else { &USUAL }
    }

    /// Whether exec is late. Motion that has just begun, or `rests`, has not much waiting yet.
    #[inline(always)]
    fn is_short(&mut self, rests: bool) -> bool {
        self.moved = if rests { 0 } else { self.moved.saturating_add(1) };
        // The end of a block behind a long segment waits alone for a moment.
        let is_end = self.fewest == 1 && self.length(1) < USUAL_LENGTH && self.length(2) >= LONG;
        let short = usize::from(self.moved) > SEGMENTS && self.sum < WAITING_SHORT && !is_end;
        if short {
            self.pressed = PRESSED_FOR;
        }
        short
    }

    /// Whether so little waits, with what the segment that runs takes yet, that it would not outlast the end of an acceleration and a ramp behind it.
    #[inline(always)]
    fn is_tight(&self) -> bool {
        let all = self.length(self.used + 1);
        let left = stepper::left().saturating_add((1 << UNIT_LOG2) - 1) >> UNIT_LOG2;
        let running = u16::try_from(left).map_or(all, |left| left.min(all));
        running + self.sum < TIGHT
    }

    /// Whether thread mode gets a turn before more is prepared, after so many segments without one.
    #[inline(always)]
    fn is_enough(&self, passed_over: u8) -> bool {
        let has_just_begun = usize::from(self.moved) <= SEGMENTS && passed_over >= FIRST_TURN;
        let least = if has_just_begun { FIRST_LEAST } else { self.limits().least };
        self.used >= self.fewest && (self.sum >= least || self.gives_way())
    }

    /// Whether another one may wait: what is queued cannot be slowed down any more, nor kept from beginning.
    #[inline(never)]
    fn room(&self) -> Room {
        if self.used >= SEGMENTS as u8 - 1 {
            return Room::None;
        }
        if self.used < self.fewest || self.sum < SOON {
            return Room::Long;
        }
        let queued = self.length(self.used + 1) + self.sum;
        let fits = |next| queued + next <= self.limits().most && !self.gives_way();
        if self.coarse && self.fewest == 1 {
            return match fits(COARSE) {
                true => Room::Long,
                // It costs as much, and thread mode has the rest: only if little waits.
                false if self.sum < LONG && fits(USUAL_LENGTH) => Room::Usual,
                false => Room::None,
            };
        }
        if fits(self.length(1)) { Room::Long } else { Room::None }
    }
}

/// Waits for the next time exec is pended.
fn exec_asked_again(level: Interrupt) -> impl Future<Output = ()> {
    let mut asked = false;
    exec::wait(level, move || core::mem::replace(&mut asked, true).then_some(()))
}
