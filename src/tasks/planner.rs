//! The planner task: canonical commands into blocks.
//!
//! Reads `Links::commands` and the settings, writes the block ring, waits for commands and for room in
//! the ring. One turn builds one block and plans the queue again: the longest turn of all tasks.

use embassy_futures::yield_now;

use super::axes::moved_by;
use super::links::Links;
use crate::config::Settings;
use crate::gcode::arc::Chords;
use crate::gcode::command::{Commands, Feed, Motion, Stop};
use crate::hal::event::{Event, wait};
use crate::hal::imp::exec;
use crate::motion::block::{Block, Kind};
use crate::motion::exec::{BLOCK_S_MIN, STEP_RATE_MAX};
use crate::motion::line::{Builder, Line, Machine};
use crate::motion::queue::BlockQueue;
use crate::units::{AXES, Length, PerAxis};

/// The planner's own state.
struct Planner {
    links: &'static Links,
    queue: BlockQueue,
    builder: Builder,
    /// Where the last block ends, machine coordinates.
    position: PerAxis<Length>,
}

/// The task.
pub async fn run(links: &'static Links, queue: BlockQueue) -> ! {
    let mut planner =
        Planner { links, queue, builder: Builder::default(), position: [Length::ZERO; AXES] };
    loop {
        links.planner_wake.wait().await;
        let commands = *links.commands.borrow();
        planner.carry_out(&commands).await;
        links.commands_taken.set(false);
        links.parser_wake.signal(());
    }
}

impl Planner {
    /// Does everything a line asks for, in order.
    async fn carry_out(&mut self, commands: &Commands) {
        let line = commands.line;
        if self.links.resync.get() {
            self.set_position(&[None; AXES], line).await;
            self.links.resync.set(false);
        }
        if let Some(ms) = commands.dwell_ms {
            self.dwell(ms, line).await;
        }
        if let Some(position) = &commands.set_position {
            self.set_position(position, line).await;
        }
        match &commands.motion {
            Motion::None => {}
            Motion::Traverse { target } => self.straight(target, None, line).await,
            Motion::Feed { target, feed } => self.straight(target, Some(*feed), line).await,
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
                    self.straight(&end, Some(Feed::PerMinute(feed)), line).await;
                }
            }
        }
        if commands.exact_stop {
            self.builder.stopped();
        }
        match commands.stop {
            Stop::None => {}
            Stop::Program => self.stop(Kind::ProgramStop, line).await,
            Stop::End => self.stop(Kind::ProgramEnd, line).await,
        }
    }

    async fn straight(&mut self, target: &PerAxis<Length>, feed: Option<Feed>, line: u32) {
        let block = {
            let settings = self.links.settings.borrow();
            let line = Line { from: &self.position, to: target, feed, line };
            self.builder.line(&line, &*settings)
        };
        self.position = *target;
        if let Some(block) = block {
            self.push(block).await;
        }
    }

    async fn dwell(&mut self, ms: u32, line: u32) {
        let block = self.builder.dwell(ms, line);
        self.push(block).await;
    }

    async fn stop(&mut self, kind: Kind, line: u32) {
        let block = self.builder.stop(kind, line);
        self.push(block).await;
    }

    /// G28.3: the position is called something else; no motor moves.
    async fn set_position(&mut self, position: &PerAxis<Option<Length>>, line: u32) {
        for (mine, new) in self.position.iter_mut().zip(position) {
            *mine = new.unwrap_or(*mine);
        }
        let block = {
            let settings = self.links.settings.borrow();
            self.builder.set_position(&self.position, line, &*settings)
        };
        self.push(block).await;
    }

    async fn push(&mut self, block: Block) {
        let links = self.links;
        wait(Event::BlockDone, || (self.queue.free() > 0).then_some(())).await;
        // There is room: this task alone fills the ring.
        let _ = self.queue.push(block);
        exec::pend();
        links.queue_count.add();
        links.reporter_wake.signal(());
        yield_now().await;
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
    fn motor_axis(&self, motor: usize) -> u8 {
        moved_by(self, motor)
    }
    fn steps(&self, motor: usize, position: Length) -> i32 {
        self.step_ratio(motor).steps(position)
    }
    fn max_step_rate(&self) -> f32 {
        STEP_RATE_MAX
    }
    fn min_block_time(&self) -> f32 {
        BLOCK_S_MIN
    }
}
