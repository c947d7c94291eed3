//! The planner task: canonical commands into blocks.
//!
//! Reads the commands of `links::commands` and the settings, writes the block queue. Waits for commands, for room in
//! the queue, and at a program stop for cycle start if the settings say so. One turn builds one block. While the task waits for a line,
//! the parser has plain moves carried out itself ([`take_at_once`]). In a queue flush the planner forgets the line,
//! has exec drop the blocks, and starts from where the motors are.

#[cfg(feature = "bed-plane")]
mod bed;
mod check;
#[cfg(feature = "printer")]
mod heat;
mod home;
mod jog;
mod merge;
mod outputs;
mod parts;
#[cfg(feature = "probing")]
mod probe;
mod seek;
mod square;
#[cfg(feature = "lathe")]
mod tap;
#[cfg(feature = "lathe")]
mod thread;

use embassy_futures::select::select;
use embassy_futures::yield_now;
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_sync::mutex::Mutex;
use merge::nothing_follows;
use parts::{ArcWalk, Ongoing, Parts};

use super::Never;
use super::alarm;
use super::common;
use super::links::{self, Changes, Links};
use super::origin;
use super::parser;
use super::ports::OTHERS;
use crate::capability::Capability;
use crate::gcode::command::{Commands, Feed, Motion, Spindle, Stop};
#[cfg(feature = "printer")]
use crate::gcode::heating::Heat;
use crate::gcode::interpreter::Modes;
use crate::gcode::modal::FeedMode;
use crate::gcode::overrides::Change;
use crate::gcode::steps::{Step, Steps};
use crate::hal::event::{Event, is_asked, wait};
use crate::hal::system;
use crate::jobs::Job;
use crate::machine::{self, Cycle};
#[cfg(feature = "printer")]
use crate::motion::advance::Lead;
use crate::motion::block::{Block, Outputs, QueuedAction};
use crate::motion::chain::Chain;
use crate::motion::dynamics::{Dynamics, MachineLimits};
use crate::motion::line::{Builder, Built, Line};
use crate::motion::pace::Drivers;
use crate::motion::queue::{self, BlockQueue, CAPACITY};
use crate::motion::smooth::Spans;
use crate::status::Status;
use crate::units::{AXES, Length, PerAxis};
#[cfg(feature = "backlash")]
use crate::{boards::MOTORS, motion::backlash::Slack, tasks::setup::slack_of};

/// The planner's own state.
// In this order: AVR reaches a field within 63 bytes of the first in one instruction.
#[repr(C)]
pub struct Planner {
    links: &'static Links,
    /// The N word of the line that is being carried out; before its move, that of the line before.
    line: u32,
    /// When the last of the lines that wait came, ms.
    waits_since: u16,
    /// How many lines in a row have not gone on with a chain.
    alone: u8,
    /// The change that exec is told of before the line.
    announcement: Announcement,
    queue: BlockQueue,
    /// The outputs that exec has been commanded to switch.
    outputs: Outputs,
    /// Exec has been told of a surface speed; in `per_turn`, that feeds are per turn.
    has_surface: bool,
    per_turn: bool,
    begun: Begun,
    /// Where the last block ends, in machine coordinates.
    position: PerAxis<Length>,
    builder: Builder,
    dynamics: Dynamics,
    /// The demands of the drivers that exec has been told of.
    drivers: Drivers,
    /// The means that exec has been told of.
    spans: Spans,
    /// The last move ends in an exact stop, at which the means are to be empty.
    stops: bool,
    /// Exec has been told of a backlash.
    #[cfg(feature = "backlash")]
    has_backlash: bool,
    /// A heater or the fan has been switched on since the last end of a program.
    #[cfg(feature = "printer")]
    heats: bool,
    /// The extruder's lead that exec has been told of.
    #[cfg(feature = "printer")]
    lead: Lead,
    /// How far the line has been carried out.
    steps: Steps,
    walk: Ongoing,
}

/// The remainder of a line.
enum Begun {
    /// Nothing is left.
    Nothing,
    /// The remaining parts of the line.
    Parts(Parts),
    /// Nothing is left. Lines are only checked, and these are the modes from before the check.
    Check(Modes),
    /// A chain: the line and lines before it, from `position` on. The next line may join it.
    Chain(Chain),
}

/// A change that exec must be told of besides lines.
#[derive(Clone, Copy, PartialEq)]
enum Announcement {
    /// Nothing has changed.
    None,
    /// The relation of steps to positions has changed: positions in steps are computed again.
    Position,
    /// The backlash of motors may have changed.
    Backlash,
    /// The demands of the drivers may have changed.
    Drivers,
    /// The means have changed.
    Smooth,
    /// The extruder's lead may have changed.
    Lead,
    /// The origin may have changed, from the next line on: a chain that waits comes first.
    Origin,
}

/// The result of a turn of the planner.
#[derive(Clone, Copy, PartialEq)]
enum Turn {
    /// There is more to do.
    More,
    /// The machine stops until a cycle start.
    Pause,
    /// The line probes.
    Probe,
    /// The line waits for the spindle.
    AwaitSpindle,
    /// The line cuts a thread.
    Thread,
    /// The line homes.
    Home,
    /// The line waits for a temperature.
    #[cfg(feature = "printer")]
    Heat,
    /// The axis is jogged.
    Jog,
    /// The line is done.
    Done,
}

/// The planner, lent to one task at a time. Its own task has it from the first block of a line to the last. The parser
/// has it for a [row](super::row), while the planner's task waits for a line.
pub type Shared = Mutex<NoopRawMutex, Planner>;

/// The task.
#[allow(clippy::manual_async_fn)] // See `tasks`.
pub fn run(links: &'static Links, shared: &'static Shared) -> impl Future<Output = Never> {
    async move {
        loop {
            let waits = shared.lock().await.has_waiting();
            match waits {
                false => links.command_receiver().woken().await,
                true => {
                    select(links.command_receiver().woken(), nothing_follows(links, shared)).await;
                }
            }
            let mut planner = shared.lock().await;
            planner.replan();
            if !links.command_receiver().has_commands() {
                planner.make_up();
            } else if planner.owes_answers() || !planner.carry_out_at_once() {
                planner.begin();
                loop {
                    planner.room().await;
                    links.give_way(PATIENCE, || queue::used_here() >= ENOUGH).await;
                    let turn = planner.turn();
                    match turn {
                        Turn::Done => break,
                        Turn::More => yield_now().await,
                        Turn::Pause => planner.cycle_start().await,
                        #[cfg(feature = "probing")]
                        Turn::Probe => planner.probe().await,
                        // No line probes without the feature.
                        #[cfg(not(feature = "probing"))]
                        Turn::Probe => {}
                        #[cfg(feature = "lathe")]
                        Turn::AwaitSpindle | Turn::Thread => {
                            planner.thread(turn == Turn::Thread).await
                        }
                        // No line cuts a thread without the feature.
                        #[cfg(not(feature = "lathe"))]
                        Turn::AwaitSpindle | Turn::Thread => {}
                        Turn::Home => planner.home().await,
                        Turn::Jog => planner.jog().await,
                        #[cfg(feature = "printer")]
                        Turn::Heat => planner.await_heat().await,
                    }
                }
            }
            // In this order, because a line is told to wait or to be carried out at any time.
            links.moves_wait.set(planner.has_waiting());
            links.command_receiver().done();
            if planner.is_flushed() {
                planner.queue.drop_staged();
                seek::drop_blocks(links.thread).await;
                if planner.restart() {
                    let resets = links.is_resetting();
                    if resets {
                        planner.stop_checks();
                    }
                    parser::end_program(links, resets);
                }
                links.moves_wait.set(planner.has_waiting());
            }
            links.parser_wake.signal();
        }
    }
}

/// Carries out the move in the slot of commands while the planner's task waits for a line, if there is room. Neither a
/// wake-up of that task nor a turn of the executor comes between. Returns false if the task has to carry the move out;
/// nothing has been done then that the task would not do. Called in the parser's turn. Cost: 9,000 cycles if a
/// block is planned; 1,400 for a move that joins a chain.
pub fn take_at_once(planner: &mut Planner) -> bool {
    if planner.is_flushed() || planner.owes_answers() {
        return false;
    }
    let waited = planner.has_waiting();
    let done = planner.carry_out_at_once();
    planner.links.moves_wait.set(planner.has_waiting());
    if planner.has_waiting() {
        if queue::used_here() <= 1 {
            // Exec may have finished a block of which the planner's task has not been told yet.
            planner.make_up();
        }
        if !waited {
            // The task limits the time for which lines wait.
            planner.links.wake_planner();
        }
    }
    done
}

/// With this many blocks queued, answers come before another block.
const ENOUGH: usize = CAPACITY / 2;
/// How many turns answers get then: enough for two answers and the other work of thread mode meanwhile.
const PATIENCE: u8 = 16;

impl Planner {
    /// Returns a planner without a move, for an empty queue.
    pub fn new(links: &'static Links, queue: BlockQueue) -> Self {
        Self {
            links,
            queue,
            builder: Builder::default(),
            dynamics: Dynamics::default(),
            position: [Length::ZERO; AXES],
            line: 0,
            drivers: Drivers::USUAL,
            spans: Spans::NONE,
            stops: false,
            #[cfg(feature = "backlash")]
            has_backlash: false,
            outputs: Outputs { on: 0, speed: 0.0 },
            has_surface: false,
            per_turn: false,
            #[cfg(feature = "printer")]
            heats: false,
            #[cfg(feature = "printer")]
            lead: Lead::NONE,
            steps: Steps::default(),
            walk: Ongoing::None,
            begun: Begun::Nothing,
            waits_since: 0,
            alone: 0,
            announcement: Announcement::None,
        }
    }

    /// Whether answers that are due come before the line, which may take up to 40,000 cycles.
    #[inline(always)]
    fn owes_answers(&self) -> bool {
        is_asked() && queue::used_here() >= ENOUGH
    }

    /// Fast path: carries out a straight move for which there is room, without waiting. Returns false for all other
    /// lines, with nothing done.
    #[inline(never)]
    fn carry_out_at_once(&mut self) -> bool {
        let commands = self.links.command_receiver().commands();
        let (target, feed) = match &commands.motion {
            Motion::Traverse { target } => (target, None),
            Motion::Feed { target, feed } => (target, Some(feed)),
            _ => return false,
        };
        if !commands.is_motion_alone() || !self.links.changes.is_empty() {
            return false;
        }
        if self.stops || self.wanted_spans(&commands) != self.spans {
            return false;
        }
        if Capability::Lathe.is_built_in() && self.turns_otherwise(&commands.motion) {
            return false;
        }
        let tolerance = self.merged(&commands);
        if let Begun::Chain(chain) = &mut self.begun
            && chain.go_on(&self.position, target, feed, tolerance)
        {
            self.alone = 0;
            self.wait_for_more(commands.line);
            return true;
        }
        // A block is to be planned, and overrides may have changed.
        self.replan();
        if self.has_chain() && (self.queue.free() == 0 || !self.close_chain()) {
            return false;
        }
        let free = self.queue.free();
        let may_merge = !commands.exact_stop && self.queue.is_busy() && self.dynamics.merges;
        if may_merge && self.is_worth_a_chain() && self.begin_chain(target, feed, &commands) {
            return true;
        }
        if free == 0 {
            return false;
        }
        self.line = commands.line;
        match self.line(target, feed.copied(), may_merge) {
            Built::Parts(_) => return false,
            Built::Merge => {
                self.begun = Begun::Chain(Chain::closed(&self.position, target));
                self.note_deviation();
            }
            Built::Line(_) | Built::Blended(_) | Built::Nothing => {
                self.begun = Begun::Nothing;
                self.moved(&commands);
                self.position = *target;
                self.announce();
            }
        }
        true
    }

    /// Begins with the line whose commands have been sent.
    #[inline(never)]
    fn begin(&mut self) {
        self.steps = Steps::default();
        self.take_up_changes();
        let commands = self.links.command_receiver().commands();
        let smooths = self.stops || self.wanted_spans(&commands) != self.spans;
        match self.announcement {
            // That of the means follows.
            Announcement::Position
            | Announcement::Backlash
            | Announcement::Drivers
            | Announcement::Smooth => {}
            _ if smooths && commands.moves() => self.announcement = Announcement::Smooth,
            Announcement::None => self.announcement = Announcement::Origin,
            Announcement::Lead | Announcement::Origin => {}
        }
    }

    /// Applies changed settings. Exec must be told of some of them before the next line.
    #[inline(never)]
    fn take_up_changes(&mut self) {
        if self.links.changes.take(Changes::SETTINGS) {
            self.dynamics.set(&*self.links.settings.borrow());
            #[cfg(feature = "printer")]
            if self.wanted_lead() != self.lead {
                self.announcement = Announcement::Lead;
            }
            self.dynamics.rounds = self.spans.is_some();
            self.let_go(false);
            self.set_blend();
            if self.knows_backlash() {
                self.announcement = Announcement::Backlash;
            }
        }
        self.outputs.on ^= self.links.changes.take_flipped();
        if self.links.changes.has(Changes::STEPS) {
            self.announcement = Announcement::Position;
        }
    }

    /// Carries out the next part of the line, which takes one block at most. There is room for a block.
    #[inline(never)]
    fn turn(&mut self) -> Turn {
        if self.is_flushed() {
            return Turn::Done;
        }
        if self.has_announced() {
            self.tell();
            return Turn::More;
        }
        let links = self.links;
        let commands = links.command_receiver().commands();
        if self.has_chain() {
            return self.end_chain(&commands);
        }
        if Capability::Lathe.is_built_in() && self.turns_otherwise(&commands.motion) {
            self.per_turn = !self.per_turn;
            self.push_aside(QueuedAction::PerTurn(self.per_turn));
            return Turn::More;
        }
        if matches!(self.begun, Begun::Parts(_)) {
            self.part(&commands);
            return Turn::More;
        }
        if self.announcement == Announcement::Origin {
            self.announcement = Announcement::None;
            if links.changes.take(Changes::ORIGIN) && self.set_origin() {
                return Turn::More;
            }
        }
        if let Ongoing::Arc(arc) = &mut self.walk
            && let Motion::Arc { target, arc: circle, .. } = &commands.motion
        {
            match arc.walk.next(circle, target) {
                Some(end) => {
                    let feed = Feed::PerMinute(arc.feed);
                    self.straight(&end, Some(feed));
                }
                None => {
                    self.walk = Ongoing::None;
                    self.moved(&commands);
                }
            }
            return Turn::More;
        }
        match self.steps.next(&commands, &self.position) {
            Some(step) => {
                // What precedes the move has the N word of the line before. The machine may stand still in between, and
                // then exec takes the line of its last block for finished.
                if !(step.precedes_motion() && commands.moves()) {
                    self.line = commands.line;
                }
                self.step(&step, &commands)
            }
            None => Turn::Done,
        }
    }

    fn step(&mut self, step: &Step, commands: &Commands) -> Turn {
        match step {
            Step::Line(target, feed) => {
                self.straight(target, *feed);
                if !self.has_begun() {
                    self.moved(commands);
                }
            }
            Step::Arc => self.begin_arc(&commands.motion),
            Step::Dwell(ms) => self.pause(QueuedAction::Dwell(*ms)),
            Step::SetPosition(position) => {
                #[cfg(feature = "bed-plane")]
                self.rename_bed(position);
                self.set_position(position);
            }
            Step::Override(change) => self.set_override(*change),
            Step::Spindle(spindle) => self.set_spindle(spindle),
            Step::Coolant(coolant) => self.set_coolant(*coolant),
            Step::Stop(Stop::End) if self.outputs.on != 0 => {
                // Another turn ends the program.
                self.switch(u8::MAX, 0, 0.0);
                self.steps.repeat();
            }
            #[cfg(feature = "printer")]
            Step::Stop(Stop::End) if self.heats => {
                self.heat(&Heat::OFF);
                self.steps.repeat();
            }
            Step::Stop(Stop::End) => self.pause(QueuedAction::ProgramEnd),
            Step::Stop(_) | Step::Tool => {
                let waits = self.links.settings.borrow().waits_at_stop();
                // The tool is reported; a sender that changes tools handles the stop itself.
                if waits || matches!(step, Step::Stop(_)) {
                    self.pause(QueuedAction::ProgramStop);
                }
                if waits {
                    return Turn::Pause;
                }
            }
            Step::Probe => return Turn::Probe,
            Step::AwaitSpindle => return Turn::AwaitSpindle,
            Step::Thread => return Turn::Thread,
            Step::Home => return Turn::Home,
            Step::Jog => return Turn::Jog,
            Step::Check => self.check(),
            #[cfg(feature = "bed-plane")]
            Step::FollowBed(follows) => self.follow_bed(*follows),
            #[cfg(feature = "printer")]
            Step::Heat(heat) => {
                if self.heat(heat) {
                    return Turn::Heat;
                }
            }
            // No line has this step.
            #[cfg(not(feature = "printer"))]
            Step::Heat(_) => {}
        }
        Turn::More
    }

    /// Whether the feed of this motion is per turn of the spindle (G95) while exec takes feeds as per minute, or the
    /// other way round. The G-code model has interpreted this line and no later one.
    #[inline(never)]
    #[small]
    fn turns_otherwise(&self, motion: &Motion) -> bool {
        let per_turn = match motion {
            Motion::None | Motion::Traverse { .. } | Motion::Through { .. } => return false,
            Motion::Feed { .. } | Motion::Arc { .. } | Motion::Probe { .. } | Motion::Cycle(_) => {
                self.links.model.borrow().modal().feed_mode == FeedMode::PerTurn
            }
            _ => false,
        };
        per_turn != self.per_turn
    }

    /// Queues a straight move, or begins with its parts if it is too long for one block.
    fn straight(&mut self, target: &PerAxis<Length>, feed: Option<Feed>) {
        match self.line(target, feed, false) {
            Built::Parts(of) => self.begun = Begun::Parts(Parts::new(target, feed, of)),
            _ => {
                self.position = *target;
                self.announce();
            }
        }
    }

    /// Queues the next part of a move, or divides all parts that are left if it is still too long.
    #[inline(never)]
    #[small]
    fn part(&mut self, commands: &Commands) {
        let Begun::Parts(parts) = &self.begun else { return };
        let (end, feed) = (parts.end(&self.position), parts.feed);
        let built = self.line(&end, feed, false);
        let Begun::Parts(parts) = &mut self.begun else { return };
        if let Built::Parts(of) = built {
            parts.divide(of);
            return;
        }
        self.position = end;
        parts.left -= 1;
        if parts.left == 0 {
            self.begun = Begun::Nothing;
            if matches!(self.walk, Ongoing::None) {
                self.moved(commands);
            }
        }
        self.announce();
    }

    /// Queues a straight move, for which there is room. Queues nothing if the move is to be made in parts or merged.
    fn line(&mut self, target: &PerAxis<Length>, feed: Option<Feed>, may_merge: bool) -> Built {
        // Before the line is built in the queue: lines that have waited may go there.
        self.keep_to_deviation();
        self.note_rest();
        let settings = self.links.settings.borrow();
        let curve = match &self.walk {
            Ongoing::Arc(ArcWalk { curve, .. }) => Some(curve),
            _ => None,
        };
        let lifted =
            settings.followed_bed().map(|bed| (bed.lifted(&self.position), bed.lifted(target)));
        let (from, to) = lifted.as_ref().map_or((&self.position, target), |(from, to)| (from, to));
        #[cfg(feature = "bed-plane")]
        let may_merge = may_merge && (lifted.is_none() || bed::is_near(&self.position, target));
        let blends = self.queue.blends();
        let line = Line { from, to, feed, curve, may_merge, blends };
        let Some(block) = self.queue.next_line() else { return Built::Nothing };
        let built = self.builder.line(&line, &self.dynamics, &*settings, block);
        if matches!(built, Built::Line(_) | Built::Blended(_)) {
            #[cfg(feature = "printer")]
            heat::refine_by(&self.lead, &settings, block, from, to);
            if let Ongoing::Arc(arc) = &mut self.walk {
                arc.curve.go_on();
            }
        }
        match built {
            Built::Line(entry) => {
                self.queue.push_unblended(entry, self.builder.unit(), self.line);
            }
            Built::Blended(begins) => {
                self.waits_from_now();
                self.queue.blend(self.builder.unit(), self.line, begins);
            }
            _ => {}
        }
        built
    }

    /// Notes that the move of the line has been queued. After an exact stop the next move begins at a standstill.
    fn moved(&mut self, commands: &Commands) {
        if commands.exact_stop {
            self.builder.stopped();
            self.stops = true;
        }
    }

    /// Tells exec what has changed besides lines, one thing at a time.
    #[inline(never)]
    #[small]
    fn tell(&mut self) {
        match self.announcement {
            Announcement::Position => {
                let position = self.position;
                self.set_position(&position);
                self.links.changes.note(Changes::ORIGIN);
                self.announcement = match self.knows_backlash() {
                    true => Announcement::Backlash,
                    false => Announcement::Drivers,
                };
            }
            Announcement::Backlash => {
                #[cfg(feature = "backlash")]
                self.set_backlash();
                self.announcement = Announcement::Drivers;
            }
            Announcement::Drivers => {
                self.set_drivers();
                self.links.changes.take(Changes::STEPS);
                self.announcement = Announcement::Smooth;
            }
            Announcement::Smooth => {
                let links = self.links;
                let commands = links.command_receiver().commands();
                // Other lines do not wait for exec; the next one that moves will.
                if commands.moves() {
                    self.smooth(self.wanted_spans(&commands));
                }
                self.announcement = Announcement::Lead;
            }
            _ => {
                #[cfg(feature = "printer")]
                self.set_lead();
                self.announcement = Announcement::Origin;
            }
        }
    }

    /// Whether exec is to be told of something before the chain that waits.
    #[inline(always)]
    fn has_announced(&self) -> bool {
        !matches!(self.announcement, Announcement::None | Announcement::Origin)
    }

    /// Tells exec the origin of the lines from here on. While nothing is queued or runs, exec has it at once. Returns
    /// whether a block has been queued.
    #[inline(never)]
    #[small]
    fn set_origin(&mut self) -> bool {
        let links = self.links;
        let origin = origin::read(&links.settings.borrow(), &links.model.borrow());
        let runs = queue::used() > 0 || self.has_waiting();
        let runs = common::with(links.thread, move |common| {
            let runs = runs || common.motion.running;
            if !runs {
                common.motion.origin = origin;
            }
            runs
        });
        if runs {
            self.push_aside(QueuedAction::Origin(origin));
        }
        runs
    }

    /// Redefines the position of the machine, as G28.3 does. No motor moves.
    #[inline(never)]
    #[small]
    fn set_position(&mut self, position: &PerAxis<Length>) {
        self.position = *position;
        let settings = self.links.settings.borrow();
        let lifted = settings.followed_bed().map(|bed| bed.lifted(position));
        let position = lifted.as_ref().unwrap_or(position);
        let action = self.builder.set_position(position, &*settings);
        drop(settings);
        self.push(Block::action(action, self.line));
    }

    /// Whether an axis has backlash, or exec has been told of one.
    #[inline(never)]
    #[small]
    fn knows_backlash(&self) -> bool {
        #[cfg(feature = "backlash")]
        let has = self.has_backlash;
        #[cfg(not(feature = "backlash"))]
        let has = false;
        has || MachineLimits::has_backlash(&*self.links.settings.borrow())
    }

    /// Tells exec the backlash of the motors, unless there is none and has been none.
    #[cfg(feature = "backlash")]
    #[inline(never)]
    #[small]
    fn set_backlash(&mut self) {
        let settings = self.links.settings.borrow();
        let mut slacks = [Slack::NONE; MOTORS];
        for (motor, slack) in slacks.iter_mut().enumerate() {
            *slack = slack_of(&settings, motor);
        }
        let has = slacks.iter().any(|slack| slack.width != 0);
        drop(settings);
        if core::mem::replace(&mut self.has_backlash, has) || has {
            self.push_aside(QueuedAction::Backlash(slacks));
        }
    }

    /// Tells exec what the drivers demand, if that has changed.
    fn set_drivers(&mut self) {
        let drivers = MachineLimits::drivers(&*self.links.settings.borrow());
        if drivers != self.drivers {
            self.drivers = drivers;
            self.push(Block::action(QueuedAction::Drivers(drivers), self.line));
        }
    }

    /// Returns the means for a line: none for one that keeps to its path exactly. Where corners keep to P, a P of 0 means
    /// so, too.
    #[inline(always)]
    fn wanted_spans(&self, commands: &Commands) -> Spans {
        let is_exact = commands.is_exact_path() || system::blends() && self.rounded() == 0;
        if is_exact { Spans::NONE } else { self.dynamics.spans }
    }

    /// Returns how far corners may be off the path, in units of [`Length`]. The G-code model has interpreted this line and
    /// no later one.
    #[inline(always)]
    fn rounded(&self) -> u16 {
        self.links.model.borrow().modal().rounded()
    }

    /// Tells exec the means, if they have changed or are to be empty. The machine stands still there.
    #[inline(never)]
    #[small]
    fn smooth(&mut self, spans: Spans) {
        let stops = core::mem::take(&mut self.stops);
        if spans != self.spans || stops && spans.is_some() {
            self.spans = spans;
            self.dynamics.rounds = spans.is_some();
            self.pause(QueuedAction::Smooth(spans));
            self.set_blend();
        }
    }

    /// Sets how far corners may be off the path from this line on. A chain has that of its first line.
    #[inline(always)]
    fn keep_to_deviation(&mut self) {
        let (chains, now) = (self.has_chain(), self.rounded());
        if let Some(stage) = self.queue.stage() {
            let units = if chains { stage.chained } else { now };
            let deviation = f32::from(units) * 1e-4;
            if stage.deviation().to_bits() != deviation.to_bits() {
                self.change_deviation(deviation);
            }
        }
    }

    /// Where lines are blended: notes that the next one has no corner, if the machine has come to rest.
    #[inline(always)]
    fn note_rest(&mut self) {
        let thread = self.links.thread;
        if let Some(stage) = self.queue.stage()
            && stage.is_empty()
            && queue::used_here() == 0
            && !common::with(thread, |common| common.motion.running)
        {
            stage.stop();
        }
    }

    #[inline(never)]
    fn change_deviation(&mut self, deviation: f32) {
        self.let_go(false);
        if let Some(stage) = self.queue.stage() {
            stage.set_deviation(deviation);
        }
    }

    /// Queues the lines that wait to be blended, and tells exec. `stops` says whether the machine stops there.
    #[inline(always)]
    fn let_go(&mut self, stops: bool) {
        if self.queue.has_staged() {
            self.queue.flush(stops);
            self.announce();
        }
    }

    /// Sets how lines are blended from here on. None waits.
    #[inline(always)]
    fn set_blend(&mut self) {
        let (spans, dynamics) = (self.spans, &self.dynamics);
        if let Some(stage) = self.queue.stage() {
            stage.set(spans, dynamics);
        }
    }

    /// Computes the keys of the queue again if other overrides are requested.
    fn replan(&mut self) {
        if let Some(wanted) = self.queue.wanted() {
            self.queue.replan(wanted);
        }
    }

    #[inline(never)]
    #[small]
    fn set_override(&mut self, change: Change) {
        self.push_aside(QueuedAction::Override(change));
    }

    /// Queues an action at which the machine does not stop. There is room: see [`Self::push`].
    #[inline(never)]
    #[small]
    fn push_aside(&mut self, action: QueuedAction) {
        let _ = self.queue.push_aside(Block::action(action, self.line));
        self.announce();
    }

    /// Queues an action that is done at a standstill.
    #[inline(never)]
    #[small]
    fn pause(&mut self, action: QueuedAction) {
        let block = self.builder.pause(action, self.line);
        self.push(block);
    }

    #[inline(never)]
    #[small]
    fn push(&mut self, block: Block) {
        // There is room: only this task fills the queue, and it checks for room before each turn.
        let _ = self.queue.push(block);
        self.announce();
    }

    fn room(&mut self) -> impl Future<Output = ()> {
        wait(self.links.thread, Event::BlockDone, || {
            self.replan();
            (self.queue.free() > 0 || self.is_flushed()).then_some(())
        })
    }

    /// Waits until the machine has come to the stop, and then for the next cycle start.
    async fn cycle_start(&self) {
        wait(self.links.thread, Event::BlockDone, || {
            (queue::used() == 0 || self.is_flushed()).then_some(())
        })
        .await;
        if self.is_flushed() {
            return;
        }
        machine::carry_out(self.links.thread, machine::Event::Stopped);
        // Without this report a sender would wait for ever.
        self.links.except(Status::ProgramStopped);
        self.links.cycle_start.take();
        self.links.cycle_start.wait().await;
        machine::carry_out(self.links.thread, machine::Event::Done);
    }

    /// Whether all that is queued is to be dropped.
    fn is_flushed(&self) -> bool {
        machine::is_dropping()
    }

    /// Starts planner and model from where the motors are, when exec has dropped its blocks. Returns whether the
    /// program is to end.
    #[inline(never)]
    #[small]
    fn restart(&mut self) -> bool {
        let links = self.links;
        if self.checks() {
            // Nothing has moved. Check mode may just have ended.
            self.check();
        } else {
            let motion = common::snapshot(links.thread);
            self.relocate(&motion);
            // The lines behind that one have been dropped.
            self.line = motion.finished;
            // The announcements of the means and of the lead may have been dropped.
            self.announcement = Announcement::Smooth;
            let spindle = Spindle { turn: outputs::turn(motion.outputs), speed: motion.speed };
            let coolant = super::spindle::coolant(motion.outputs);
            links.changes.take_flipped();
            let surface = motion.surface.first().filter(|surface| surface.is_on());
            links.model.borrow_mut().set_outputs(&spindle, surface, coolant);
        }
        #[cfg(feature = "printer")]
        if machine::is_killing() {
            super::heat::forget_orders(links.thread);
        }
        links.job.set(Job::default());
        #[cfg(feature = "sd")]
        links.card.borrow_mut().interrupt();
        let (cycle, killed) = machine::dropped(self.links.thread);
        match cycle {
            Cycle::Jog => links.notices.jogged.set(true),
            Cycle::Homing => {
                // The motors of an axis may have moved apart, so positions in steps are computed again.
                links.changes.note(Changes::STEPS);
                // An alarm has already reported what ended the cycle, and a reset will be.
                if !machine::is_alarmed() && links.interrupter().is_none() {
                    alarm::announce(links, Status::HomingFailed, alarm::NO_PORT);
                }
            }
            Cycle::Probe => links.probe.abandon(),
            // Check mode was about to begin.
            Cycle::Check if !self.checks() => {
                machine::carry_out(self.links.thread, machine::Event::Done)
            }
            Cycle::Lines | Cycle::Stopped | Cycle::Check => {}
        }
        // If a sender begins with a reset, nothing is reported, because there was no job.
        let ended = !links.ports.iter().any(|port| port.asked.get() & OTHERS != 0);
        if killed && ended && cycle != Cycle::Homing {
            links.except(Status::KillJob);
        }
        links.notices.flushed.set(ended && !machine::is_alarmed());
        if killed
            && let Some(by) = links.interrupter()
            && !machine::is_alarmed()
        {
            // Before any other line is begun: lines that have come since the reset are refused.
            machine::start_alarmed(self.links.thread);
            alarm::announce(links, Status::Alarmed, by);
        }
        links.reporter_wake.notify_now();
        killed
    }

    /// Sets what the machine does besides carrying out lines, and has it reported at once.
    fn enter(&self, cycle: machine::Event) {
        machine::carry_out(self.links.thread, cycle);
        self.links.reporter_wake.notify_now();
    }

    /// Tells exec and the reporter that a block has been queued.
    fn announce(&self) {
        links::feed();
        self.links.queue_count.add();
        self.links.reporter_wake.signal();
    }
}
