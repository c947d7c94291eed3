//! The exec task: keeps the segment ring full. The only task of the exec executor.
//!
//! Reads the block ring, writes the segment ring, waits for a free segment slot, a new block, or the steppers to stop
//! (each pends the exec interrupt). A segment costs 4,000 to 12,000 cycles, 24,000 at worst. One run prepares the
//! segments for the next few milliseconds ([`Amount::least`]). Further segments are prepared one by one, each when a
//! segment is used up or when thread mode has nothing else to do; meanwhile thread mode can answer a line. When too
//! little motion waits ([`WAITING_SHORT`]), stretches become twice as long, and for a while more motion is queued
//! ([`PRESSED`]).

use avr_embassy::InterruptEnd;

use crate::dda::contact;
use crate::dda::{SEGMENTS, Segment};
use crate::encoder::Encoder;
use crate::hal::arithmetic::product;
use crate::hal::event::{self, Event};
use crate::hal::segments::Segments;
use crate::hal::{Interrupt, TIMER_HZ, encoder as sensors, exec, flags, stepper, uart};
use crate::machine::{self, Alarm};
use crate::motion::exec::{Exec, Step, take_heat, take_override};
use crate::motion::finished::Finished;
use crate::motion::queue::BlockSource;
use crate::motion::snapshot::{Program, Snapshot};
use crate::motion::thread::Thread;
use crate::tasks::health::{self, Sign};
use kerf_macros::small;

use crate::boards::outputs;
use crate::capability::Capability;
use crate::motors::Motors;
use crate::spindle::Spindle;
use crate::status::Status;
use crate::tasks::common::{Common, State};
use crate::tasks::{Never, hold, links, overrides, power, spindle};

/// After more than this many segments without a turn of thread mode, segments become longer, which takes less CPU
/// time.
const PATIENCE: u8 = 6;

/// While motion has just begun, thread mode gets a turn after this many segments. To fill the ring from empty to the
/// usual amount without a turn would take 6 ms.
const FIRST_TURN: u8 = 2;

/// The task.
#[allow(clippy::manual_async_fn)] // See `tasks`.
pub fn run(
    level: Interrupt,
    common: InterruptEnd<Common>,
    blocks: BlockSource,
    segments: Segments,
) -> impl Future<Output = Never> {
    async move {
        // A separate variable: otherwise it would be built on the stack and copied.
        let mut machine = Exec::new();
        let mut task = Task::new(level, common, blocks, segments, &mut machine);
        loop {
            match exec::wait(level, || task.go_on()).await {
                Next::Idle => exec::pend_when_idle(),
                Next::Room => exec::note_idle(),
                Next::Block | Next::Turn => links::wait_for_block(level, true),
            }
            exec_asked_again(level).await;
            links::wait_for_block(level, false);
        }
    }
}

/// CPU cycles from the start of the steppers to their first tick.
const FIRST_TICK: u32 = 400;

/// The condition for the next turn of the task.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Next {
    /// Exec takes the next turn at once, if there is room.
    Turn,
    /// Exec takes the next turn when thread mode is idle or a segment has been used up, if there is room then.
    Idle,
    /// Exec takes the next turn when a segment has been used up.
    Room,
    /// Exec waits until something pends it: a block, the steppers at a standstill, the end of a hold.
    Block,
}

/// The state that the task owns.
struct Runner<'a> {
    /// The proof that the runner is in interrupt mode.
    level: Interrupt,
    waiting: Waiting,
    finished: Finished,
    /// The machine stands still at the end of what has been queued.
    rests: bool,
    /// At the next turn, `waiting` is to be told whether thread mode has been idle since the last segment.
    asked: bool,
    segments: Segments,
    blocks: BlockSource,
    machine: &'a mut Exec,
}

/// The runner, and exec's end of the state that it shares with thread mode.
struct Task<'a> {
    runner: Runner<'a>,
    common: InterruptEnd<Common>,
}

impl<'a> Task<'a> {
    /// Not inlined: otherwise the task would be built on the stack and copied.
    #[inline(never)]
    #[small]
    fn new(
        level: Interrupt,
        common: InterruptEnd<Common>,
        blocks: BlockSource,
        segments: Segments,
        machine: &'a mut Exec,
    ) -> Self {
        let (waiting, finished) = (Waiting::new(), Finished::new());
        let (rests, asked) = (true, false);
        let runner = Runner { level, waiting, finished, rests, asked, segments, blocks, machine };
        Self { runner, common }
    }

    /// Takes turns as long as there is room. Returns what the task waits for next, or `None` if it waits for room.
    ///
    /// Not inlined: the CPU then reaches the fields of the runner from a pointer to the runner, not from one to the
    /// future.
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
    /// Returns the room in the ring. `None` if there is no room for a segment and the steppers have not been stopped.
    #[inline(always)]
    fn is_due(&mut self) -> Option<Room> {
        health::answer(self.level, Sign::Exec);
        self.waiting.update(self.segments.used());
        let room = self.waiting.room();
        let due = room != Room::None || stepper::is_stopped();
        if due && self.asked {
            self.asked = false;
            self.waiting.go_on(exec::was_idle());
        }
        due.then_some(room)
    }

    /// Takes one turn, which is one step of the machine. Returns what the task waits for next.
    #[inline(always)]
    fn turn(&mut self, room: Room, common: &mut InterruptEnd<Common>) -> Next {
        uart::stop_late(self.level);
        let released = self.blocks.released();
        let rested = self.rests;
        if contact::is_noted() {
            contact::catch_up(self.level, &self.segments);
        }
        let standstill = !stepper::running();
        self.machine.set_long(room == Room::Long);
        let step = common.with(|common| self.step(standstill, common));
        if self.blocks.released() != released {
            flags::set(Event::BlockDone);
        }
        match step {
            Step::Segment => {
                let passed_over = self.queued(rested);
                // The time of the start is read before it: behind it, the first tick may already have interrupted exec,
                // and a pass would be off by the time that this tick took.
                if standstill && let Some(thread) = self.machine.thread() {
                    common.with(|common| start_thread(thread, &common.encoder));
                }
                stepper::go(self.level);
                self.next_turn(passed_over)
            }
            Step::Held if machine::rested(self.level) => Next::Turn,
            Step::Idle | Step::Standstill | Step::Held => Next::Block,
            Step::Again | Step::Leaves | Step::Switched | Step::Override | Step::Heat => Next::Turn,
        }
    }

    /// Carries out the next step of the machine and acts on its result. A segment goes into the ring.
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
        let holds = hold::is_wanted(self.level, out.running) || contact::is_noted() || left;
        self.machine.set_hold(holds, out);
        // An output that was paused in a hold is switched on again before motion resumes.
        if out.outputs != spindle::on() {
            if !machine::is_held() {
                spindle.go_on();
            }
            let ms = spindle::switch(self.level.exclusive(), spindle, out, false);
            // Within G33.1 the axes follow the encoder and do not wait.
            if !self.machine.needs_spindle() {
                self.machine.wait(ms, out);
            }
        }
        if let Some(line) = self.finished.take(used) {
            out.finished = line;
        }
        let line = out.line;
        let step = self.next_step(standstill, out, motors);
        if out.line != line {
            self.finished.end(line, self.machine.lag());
        }
        match step {
            Step::Segment => self.finished.queue(),
            Step::Override => {
                let change = take_override(&mut self.blocks);
                overrides::change_in_stream(self.level, overrides, change, &mut self.blocks)
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
            Step::Switched => {
                self.machine.wait(spindle::switch(self.level.exclusive(), spindle, out, true), out)
            }
            Step::Again | Step::Leaves | Step::Idle | Step::Standstill | Step::Heat => {}
        }
        // A standstill lasts until a segment ends it, because `out.velocity` is ahead of the segments.
        self.rests = out.velocity.to_bits() == 0 || (self.rests && step != Step::Segment);
        step
    }

    #[inline(always)]
    fn next_step(&mut self, standstill: bool, out: &mut Snapshot, motors: &mut Motors) -> Step {
        // In an alarm that has stopped the steps, the end of a program is still carried out.
        if stepper::is_stopped() && !machine::is_locked() {
            return Step::Held;
        }
        // There is room: this task alone fills the ring.
        let Some(mut slot) = self.segments.slot() else {
            return Step::Standstill;
        };
        let step = self.machine.step(&mut self.blocks, standstill, out, &mut slot);
        if step == Step::Segment {
            power::segment(self.level.exclusive(), motors, slot.moving);
            let cycles = product(slot.ticks, slot.period);
            self.waiting.push(cycles);
            if let Some(thread) = self.machine.thread() {
                thread.queued(cycles, standstill);
            }
            if contact::is_noted() {
                contact::pushed(self.level, &slot);
            }
            slot.publish();
        }
        step
    }

    /// Handles the standstill in a hold: switches the outputs, and drops the queue if the planner has requested that.
    #[inline(never)]
    #[small]
    fn held(&mut self, out: &mut Snapshot, spindle: &mut Spindle) {
        if !self.machine.needs_spindle() {
            spindle::switch(self.level.exclusive(), spindle, out, false);
        }
        machine::drop_if_wanted(self.level, || {
            // When a program is dropped, a paused output stays off. A kill switches off all outputs here, because the
            // end of the program, which would do so too, may have to wait for a door. The remainder of a pass is
            // dropped as well, but its program goes on.
            if machine::is_dropping() || machine::is_alarmed() {
                out.outputs = if machine::is_killing() { 0 } else { spindle::on() };
                if out.outputs & outputs::SPINDLE == 0 {
                    out.speed = 0.0;
                }
                spindle.go_on();
                spindle::switch(self.level.exclusive(), spindle, out, false);
            }
            let held = self.machine.drop_all(&mut self.blocks, out);
            stepper::settle(self.level, held, &mut out.target);
            if Capability::Lathe.is_built_in() && machine::is_dropping() {
                self.machine.end_pass();
            }
            self.finished.rest();
            if machine::alarm() >= Alarm::Shutdown {
                out.program = Program::Ready;
            }
        });
    }

    /// Adds the retract of X to the segments that already wait in the ring.
    #[inline(never)]
    #[small]
    fn lead(&mut self, out: &mut Snapshot, motors: &mut Motors) {
        let Self { segments, machine, .. } = self;
        let (leaving, is_backwards) = machine.leaving();
        // Only for a single motor. Several would take too long; they begin in segments of their own.
        let motor = match leaving {
            1 => 0,
            2 => 1,
            4 => 2,
            8 => 3,
            _ => return,
        };
        power::segment(self.level.exclusive(), motors, leaving);
        let mut back = segments.used();
        while back > 0 {
            back -= 1;
            let Some(waits) = segments.copy_of(back) else { continue };
            let moving = waits.moving | leaving;
            let turned = if is_backwards { leaving } else { 0 };
            let backwards = core::hint::black_box(waits.backwards & !leaving | turned);
            let mode = Segment::mode_of(moving);
            // In the taper of a thread X moves already.
            let stands = waits.increment.get(motor) == Some(&0);
            machine.lead((waits.ticks, waits.period), out, |increment| {
                // Two pieces, so that a step waits for 31 cycles at most. The first piece moves nothing.
                stands
                    && segments.amend(back, |segment| {
                        (segment.backwards, segment.mode) = (backwards, mode);
                    })
                    && segments.amend(back, |segment| {
                        if let Some(of) = segment.increment.get_mut(motor) {
                            *of = increment;
                        }
                    })
            });
        }
    }

    /// Acts on a new segment in the ring: decides how long the next ones are to be. `rested` says whether the machine
    /// stood still before that segment. Returns how often thread mode has been passed over.
    #[inline(always)]
    fn queued(&mut self, rested: bool) -> u8 {
        let Self { waiting, segments, rests, .. } = self;
        health::moves(self.level, waiting.count);
        waiting.update(segments.used());
        let short = waiting.is_short(*rests);
        let passed_over = event::pass_over(self.level);
        // While an answer is due, a ramp in stretches of the usual length would delay it by 9 ms.
        let asked = event::is_asked();
        waiting.coarse = short || asked || passed_over > PATIENCE || waiting.is_busy();
        self.machine.set_coarse(waiting.coarse, short);
        if !rested {
            health::look_for_starvation(self.level);
        }
        passed_over
    }

    /// Decides when exec takes its next turn, and whether thread mode gets a turn before it.
    #[inline(always)]
    fn next_turn(&mut self, passed_over: u8) -> Next {
        let Self { waiting, .. } = self;
        if !waiting.is_enough(passed_over) {
            return Next::Turn;
        }
        self.asked = true;
        if waiting.room() == Room::None { Next::Room } else { Next::Idle }
    }
}

/// Takes a sample of the encoder, which a pass in step with the spindle follows. Not inlined, so that it uses the stack
/// only while it runs.
#[inline(never)]
#[small]
fn look_at_spindle(exec: &mut Exec, encoder: &mut Encoder) {
    let pulses = sensors::read();
    let velocity = exec.velocity();
    let Some(thread) = exec.thread() else { return };
    if !thread.has_begun() && machine::is_held() {
        return thread.wait_anew();
    }
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
        // Wakes the planner, which waits for the end of the pass.
        flags::set(Event::BlockDone);
    }
    exec.break_off(machine::is_alarmed() || machine::is_killing());
}

/// Notes why a pass has been left, and wakes the planner. Does nothing if the pass has come to another end already.
#[inline(never)]
#[small]
fn note_left(encoder: &mut Encoder, why: Status) {
    if encoder.pass == Status::Ok {
        encoder.pass = why;
        flags::set(Event::BlockDone);
    }
}

/// Scales feeds per turn to the measured speed of the spindle, if there is an encoder. The S word is the speed that
/// they were planned for.
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

/// Passes the start time of the steppers to a pass: they are started now, and their first tick comes [`FIRST_TICK`] cycles
/// later.
#[inline(never)]
#[small]
fn start_thread(thread: &mut Thread, encoder: &Encoder) {
    thread.anchor(encoder.time_at(sensors::read().now), FIRST_TICK);
}

/// The durations of the segments that wait in the ring, in units of 2^11 CPU cycles.
struct Waiting {
    /// The lengths of the last segments. The newest is at `count - 1`, modulo `SEGMENTS`.
    lengths: [u8; SEGMENTS],
    /// Segments queued, modulo 256.
    count: u8,
    /// Stretches are twice as long, if there is room for them.
    coarse: bool,
    /// How many segments wait, as of the last `update`; in `sum`, how long they take together.
    used: u8,
    sum: u16,
    /// For how many more segments [`PRESSED`] applies.
    pressed: u8,
    /// Segments since the machine stood still.
    moved: u8,
    /// How many segments in a row were used up before thread mode became idle.
    busy: u8,
}

/// The room in the ring.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Room {
    /// There is no room for another segment.
    None,
    /// There is room for a segment of the usual length.
    Usual,
    /// There is room for a segment that is twice as long.
    Long,
}

/// Thread mode counts as busy when this many segments in a row were used up before it became idle.
const BUSY: u8 = 3;

/// The unit of lengths as a power of two: shifts are cheaper than divisions.
const UNIT_LOG2: u8 = 11;

/// Converts tenths of a millisecond into units.
const fn units(tenths: u32) -> u16 {
    ((TIMER_HZ / 10_000 * tenths) >> UNIT_LOG2) as u16
}

/// How much motion is queued, in units of 2^11 CPU cycles.
struct Amount {
    /// The most that may be queued, the segment that runs included.
    most: u16,
    /// The amount that is prepared before thread mode gets a turn.
    least: u16,
}

/// The usual amount. It is small enough for a feedhold to begin within 10 ms. It is large enough to outlast an
/// override, and the layout of a ramp, which takes up to 4.1 ms while ticks take two thirds of the CPU.
const USUAL: Amount = Amount { most: units(88), least: units(42) };

/// Applies for a while after too little motion was queued: more is prepared in one run. A feedhold still begins within
/// 10 ms.
const PRESSED: Amount = Amount { most: units(94), least: units(65) };

/// For how many segments [`PRESSED`] applies.
const PRESSED_FOR: u8 = 100;

/// With less than this waiting, exec is late, and makes longer stretches.
const WAITING_SHORT: u16 = units(25);

/// With less than this waiting, another segment may be queued in any case, unless the ring is full.
const SOON: u16 = units(20);

/// A segment that takes at least this long may wait alone.
const LONG: u16 = units(30);

/// The length of a usual stretch that is not cut short by the end of a block.
const USUAL_LENGTH: u16 = units(20);
/// The greatest length of a stretch while thread mode is busy.
const COARSE: u16 = units(40);

/// While motion has just begun, at least this much waits before thread mode gets a turn. Exec takes this long for a
/// segment at worst.
const FIRST_LEAST: u16 = units(15);

impl Waiting {
    const fn new() -> Self {
        Self {
            lengths: [0; SEGMENTS],
            count: 0,
            coarse: false,
            used: 0,
            sum: 0,
            pressed: 0,
            moved: 0,
            busy: 0,
        }
    }

    /// Returns the length of the segment that was queued `back` segments before the next one; 1 is the newest.
    #[inline(always)]
    fn length(&self, back: u8) -> u16 {
        let at = usize::from(self.count.wrapping_sub(back)) % SEGMENTS;
        self.lengths.get(at).copied().unwrap_or_default().into()
    }

    /// Counts a new segment, which takes this many CPU cycles.
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

    /// Takes out the segments that have been used up. No more than `used` segments wait now.
    #[inline(always)]
    fn update(&mut self, used: usize) {
        while self.used > used as u8 {
            self.sum -= self.length(self.used);
            self.used -= 1;
        }
    }

    /// Counts the segments that were used up in a row before thread mode became `idle`.
    fn go_on(&mut self, idle: bool) {
        self.busy = if idle { 0 } else { self.busy.saturating_add(1) };
    }

    /// Whether thread mode has no time left. Stretches are longer then, which leaves more time to thread mode.
    fn is_busy(&self) -> bool {
        self.busy >= BUSY
    }

    /// Whether thread mode gets the CPU because a request waits for it and enough motion is queued.
    #[inline(always)]
    fn gives_way(&self) -> bool {
        event::is_asked() && self.sum >= USUAL.least
    }

    fn limits(&self) -> &'static Amount {
        if self.pressed > 0 { &PRESSED } else { &USUAL }
    }

    /// Whether exec is late. Never true for motion that has just begun, or for a machine that `rests`: not much can
    /// wait yet.
    #[inline(always)]
    fn is_short(&mut self, rests: bool) -> bool {
        self.moved = if rests { 0 } else { self.moved.saturating_add(1) };
        // After a long segment, the end of a block may wait alone for a moment.
        let is_end = self.length(1) < USUAL_LENGTH && self.length(2) >= LONG;
        let short = usize::from(self.moved) > SEGMENTS && self.sum < WAITING_SHORT && !is_end;
        if short {
            self.pressed = PRESSED_FOR;
        }
        short
    }

    /// Whether enough is queued for thread mode to get a turn. `passed_over` is how many segments it has had none for.
    #[inline(always)]
    fn is_enough(&self, passed_over: u8) -> bool {
        let has_just_begun = usize::from(self.moved) <= SEGMENTS && passed_over >= FIRST_TURN;
        let least = if has_just_begun { FIRST_LEAST } else { self.limits().least };
        self.used > 0 && (self.sum >= least || self.gives_way())
    }

    /// Returns the room in the ring. The queued amount is limited because queued segments can be neither slowed down
    /// nor held.
    #[inline(never)]
    fn room(&self) -> Room {
        if self.used >= SEGMENTS as u8 - 1 {
            return Room::None;
        }
        if self.used == 0 || self.sum < SOON {
            return Room::Long;
        }
        let queued = self.length(self.used + 1) + self.sum;
        let fits = |next| queued + next <= self.limits().most && !self.gives_way();
        if self.coarse {
            return match fits(COARSE) {
                true => Room::Long,
                // A usual segment costs as much CPU time as a long one, which thread mode then lacks. So it is made
                // only if little waits.
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
