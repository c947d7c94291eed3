//! The planner task: canonical commands into blocks.
//!
//! Reads `Links::commands` and the settings, writes the block queue, waits for commands and for room in
//! the queue. One turn builds one block.

use embassy_futures::yield_now;

use super::axes::moved_by;
use super::links::{self, Links};
use crate::config::{Settings, StepRatio};
use crate::gcode::arc::Chords;
use crate::gcode::command::{Commands, Feed, Motion, Stop};
use crate::hal::event::{Event, wait};
use crate::motion::block::{Block, Body, Line as Move};
use crate::motion::dynamics::{Dynamics, Machine};
use crate::motion::line::{Builder, Built, Line, Motors};
use crate::motion::pace::Drivers;
use crate::motion::queue::BlockQueue;
use crate::units::{AXES, Length, PerAxis};

/// The planner's own state.
struct Planner {
    links: &'static Links,
    queue: BlockQueue,
    builder: Builder,
    dynamics: Dynamics,
    /// Where the last block ends, machine coordinates.
    position: PerAxis<Length>,
    /// The N word of the line that is carried out.
    line: u32,
    /// What exec has been told that drivers ask for.
    drivers: Drivers,
}

/// The task.
pub async fn run(links: &'static Links, queue: BlockQueue) -> ! {
    let mut planner = Planner {
        links,
        queue,
        builder: Builder::default(),
        dynamics: Dynamics::default(),
        position: [Length::ZERO; AXES],
        line: 0,
        drivers: Drivers::USUAL,
    };
    loop {
        links.planner_wake.wait().await;
        if !planner.carry_out_at_once() {
            let commands = *links.commands.borrow();
            planner.carry_out(&commands).await;
        }
        links.commands_taken.set(false);
        links.parser_wake.signal();
    }
}

impl Planner {
    /// Most lines are a straight move for which there is room: no need to copy what they ask for, nor
    /// to be prepared for a wait. False, and nothing done, for all others.
    #[inline(never)]
    fn carry_out_at_once(&mut self) -> bool {
        let commands = self.links.commands.borrow();
        let (target, feed) = match &commands.motion {
            Motion::Traverse { target } => (target, None),
            Motion::Feed { target, feed } => (target, Some(*feed)),
            _ => return false,
        };
        let alone = commands.dwell_ms.is_none()
            && commands.set_position.is_none()
            && commands.stop == Stop::None;
        let quiet = !self.links.settings_changed.get() && !self.links.resync.get();
        if !alone || !quiet || self.queue.free() == 0 {
            return false;
        }
        self.line = commands.line;
        if self.line(target, feed).is_some() {
            return false;
        }
        if commands.exact_stop {
            self.builder.stopped();
        }
        self.position = *target;
        self.announce();
        true
    }

    /// Does everything a line asks for, in order.
    async fn carry_out(&mut self, commands: &Commands) {
        self.line = commands.line;
        if self.links.settings_changed.replace(false) {
            self.dynamics = Dynamics::new(&*self.links.settings.borrow());
        }
        if self.links.resync.get() {
            self.set_position(&[None; AXES]).await;
            self.set_drivers().await;
            self.links.resync.set(false);
        }
        if let Some(ms) = commands.dwell_ms {
            self.pause(Body::Dwell(ms)).await;
        }
        if let Some(position) = &commands.set_position {
            self.set_position(position).await;
        }
        match &commands.motion {
            Motion::None => {}
            Motion::Traverse { target } => self.straight(target, None).await,
            Motion::Feed { target, feed } => self.straight(target, Some(*feed)).await,
            Motion::Arc { target, feed, arc } => {
                let tolerance = self.links.settings.borrow().chordal_tolerance();
                let start = self.position;
                let chords = Chords::new(&start, target, arc, tolerance);
                // The time of an inverse-time arc is that of all its chords together.
                let feed = match *feed {
                    Feed::Minutes(minutes) if minutes > 0.0 => chords.length() / minutes,
                    Feed::Minutes(_) => f32::MAX,
                    Feed::PerMinute(rate) => rate,
                };
                for end in chords {
                    self.straight(&end, Some(Feed::PerMinute(feed))).await;
                }
            }
        }
        if commands.exact_stop {
            self.builder.stopped();
        }
        match commands.stop {
            Stop::None => {}
            Stop::Program => self.pause(Body::ProgramStop).await,
            Stop::End => self.pause(Body::ProgramEnd).await,
        }
    }

    async fn straight(&mut self, target: &PerAxis<Length>, feed: Option<Feed>) {
        self.room().await;
        if let Some(parts) = self.line(target, feed) {
            self.parts(target, feed, parts).await;
        }
        self.position = *target;
        self.pushed().await;
    }

    /// Queues a straight move, for which there is room, or says in how many parts it is to be made.
    fn line(&mut self, target: &PerAxis<Length>, feed: Option<Feed>) -> Option<u16> {
        let settings = self.links.settings.borrow();
        let line = Line { from: &self.position, to: target, feed };
        let mut block = Move::default();
        match self.builder.line(&line, &self.dynamics, &*settings, &mut block) {
            Built::Nothing => None,
            Built::Parts(parts) => Some(parts),
            Built::Line(entry) => {
                self.queue.push_line(&mut block, entry, self.line);
                None
            }
        }
    }

    /// A move that is too long for one block.
    #[inline(never)]
    fn part(start: &PerAxis<Length>, target: &PerAxis<Length>, n: u16, of: u16) -> PerAxis<Length> {
        let mut end = *target;
        for axis in 0..AXES {
            let way = i64::from(target[axis].0) - i64::from(start[axis].0);
            let part = way * i64::from(n) / i64::from(of);
            end[axis] = Length((i64::from(start[axis].0) + part) as i32);
        }
        end
    }

    async fn parts(&mut self, target: &PerAxis<Length>, feed: Option<Feed>, of: u16) {
        let start = self.position;
        // Inverse time is that of the whole.
        let feed = match feed {
            Some(Feed::Minutes(minutes)) => Some(Feed::Minutes(minutes / f32::from(of))),
            other => other,
        };
        for n in 1..=of {
            let end = Self::part(&start, target, n, of);
            self.room().await;
            // Not longer than a block: the steps have been counted.
            let _ = self.line(&end, feed);
            self.position = end;
            self.pushed().await;
        }
    }

    /// Something that is done at rest.
    async fn pause(&mut self, body: Body) {
        let block = self.builder.pause(body, self.line);
        self.push(block).await;
    }

    /// G28.3: the position is called something else; no motor moves.
    async fn set_position(&mut self, position: &PerAxis<Option<Length>>) {
        for (mine, new) in self.position.iter_mut().zip(position) {
            *mine = new.unwrap_or(*mine);
        }
        let body = {
            let settings = self.links.settings.borrow();
            self.builder.set_position(&self.position, &*settings)
        };
        self.push(Block { body, line: self.line }).await;
    }

    /// Tells exec what the drivers ask for, if that has changed.
    async fn set_drivers(&mut self) {
        let drivers = Machine::drivers(&*self.links.settings.borrow());
        if drivers != self.drivers {
            self.drivers = drivers;
            self.push(Block { body: Body::Drivers(drivers), line: self.line }).await;
        }
    }

    async fn push(&mut self, block: Block) {
        self.room().await;
        // There is room: this task alone fills the queue.
        let _ = self.queue.push(block);
        self.pushed().await;
    }

    async fn room(&self) {
        wait(Event::BlockDone, || (self.queue.free() > 0).then_some(())).await;
    }

    /// Tells the others, and lets them run.
    async fn pushed(&self) {
        self.announce();
        yield_now().await;
    }

    fn announce(&self) {
        links::feed();
        self.links.queue_count.add();
        self.links.reporter_wake.signal();
    }
}

impl Motors for Settings {
    fn motor_axis(&self, motor: usize) -> u8 {
        moved_by(self, motor)
    }
    fn ratio(&self, motor: usize) -> StepRatio {
        self.step_ratio(motor)
    }
}

impl Machine for Settings {
    fn velocity_max(&self, axis: usize) -> f32 {
        Settings::velocity_max(self, axis)
    }
    fn feedrate_max(&self, axis: usize) -> f32 {
        Settings::feedrate_max(self, axis)
    }
    fn jerk_max(&self, axis: usize) -> f32 {
        Settings::jerk_max(self, axis)
    }
    fn accel_max(&self, axis: usize) -> f32 {
        Settings::accel_max(self, axis)
    }
    fn junction_deviation(&self, axis: usize) -> f32 {
        Settings::junction_deviation(self, axis)
    }
    fn junction_acceleration(&self) -> f32 {
        Settings::junction_acceleration(self)
    }
    fn drivers(&self) -> Drivers {
        Drivers { pulse_us: self.step_pulse_us(), setup_us: self.direction_setup_us() }
    }
}
