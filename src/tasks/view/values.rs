//! Values as they are now: the numbers that reports and questions are about.

use kerf_macros::small;

use super::{View, queue_free};
use crate::boards::outputs;
use crate::gcode::modal::{Coolant, Turn};
#[cfg(feature = "drivers")]
use crate::hal::drivers;
use crate::hal::serial::capacity;
use crate::hal::{encoder, gpio, uart, watchdog};
use crate::machine;
use crate::motion::queue;
use crate::protocol::{Speech, Value, thousandths};
use crate::tasks::health;
use crate::tasks::links::Last;
use crate::tasks::overrides;
use crate::tasks::turning;

/// Returns a value as it is now, or as it was at the moment of the report.
#[small]
#[inline(always)]
pub(super) fn value(view: &mut View<'_>, value: Value) -> i32 {
    match value {
        Value::Working => view.has_work().into(),
        Value::MovesLast => (view.links.last.get() == Last::Moves).into(),
        Value::PausesLast => (view.links.last.get() == Last::Pauses).into(),
        Value::Running => view.motion().running.into(),
        // Lines that move nothing are finished when all lines before them are.
        Value::FinishedLine if view.stands() => modal(view, Value::BlockLine),
        Value::Flow => view.links.model.borrow().flow().into(),
        Value::FinishedLine => view.motion().finished.get() as i32,
        Value::MotionLine => view.motion().line.get() as i32,
        Value::Velocity => thousandths(view.motion().velocity * 60.0),
        Value::QueueFree => queue_free() as i32,
        Value::BlocksFree => queue::free() as i32,
        Value::QueueAdded => view.links.queue_count.take_added(),
        Value::QueueRemoved => view.links.queue_count.take_removed(),
        Value::SlotsFree => view.port.promise(view.links.thread, &view.port.lines.borrow()).into(),
        Value::BytesInAll => capacity(view.port.number).into(),
        Value::BytesFree => uart::room(view.links.thread, view.port.number).into(),
        Value::MachinePosition(axis) => view.position(axis.into()).0,
        Value::Position(axis) => {
            let axis = axis.into();
            view.position(axis).0.wrapping_sub(view.offset(axis).0)
        }
        Value::Offset(axis) => view.offset(axis.into()).0,
        Value::Shift(axis) => {
            view.links.model.borrow().shift().get(usize::from(axis)).map_or(0, |shift| shift.0)
        }
        Value::TableRow(row, axis) => view.links.storage.value(row, axis).0,
        Value::Powered(motor) => i32::from(gpio::powered() >> motor & 1),
        Value::Target(axis) => {
            view.links.model.borrow().position().get(usize::from(axis)).map_or(0, |at| at.0)
        }
        Value::Steps(motor) => view.motion().position.get(usize::from(motor)).map_or(0, |at| *at),
        Value::Homed(axis) => i32::from(view.links.model.borrow().is_homed(axis)),
        Value::Override(which) => overrides::now(view.links.thread).factor(which).into(),
        Value::OverrideOn(which) => overrides::now(view.links.thread).is_on(which).into(),
        Value::Tool => view.motion().origin.tool.into(),
        Value::Coordinates => view.motion().origin.system.into(),
        Value::Choice => view.port.choice.get() as i32,
        Value::SelectedTool => view.links.model.borrow().selected_tool().into(),
        Value::Input(input) => view.input(input),
        Value::ProbeState => view.links.probe.state() as i32,
        // Only answers of a dialect in order wait for the report of a probing.
        Value::ProbeUntold => {
            let is_told = || view.port.number == view.links.told().number;
            i32::from(Speech::HAS_QUESTION && view.links.probe.is_untold() && is_told())
        }
        Value::Probed(axis) => view.links.probe.at(axis).map_or(0, |at| at.0),
        Value::LimitHit => match view.links.notices.limits_hit.get() {
            0 => -1,
            hit => hit.trailing_zeros() as i32,
        },
        Value::Reset => watchdog::cause() as i32,
        Value::SpindleSpeed => match turning::speed(view.links.thread) {
            Some(speed) => speed,
            None => view.programmed_speed(),
        },
        Value::SpindleOn => view.is_on(outputs::SPINDLE),
        Value::SpindleDirection => view.is_on(outputs::COUNTERCLOCKWISE),
        Value::Mist => view.is_on(outputs::MIST),
        Value::Flood => view.is_on(outputs::FLOOD),
        Value::PulsesPerTurn => turning::per_turn(view.links.thread).into(),
        Value::SyncError => turning::error(view.links.thread).into(),
        Value::Pass => turning::pass(view.links.thread) as i32,
        Value::PulseMisfits => turning::misfits(view.links.thread).into(),
        Value::Starvations => health::starvations().into(),
        Value::UsbRestarts => uart::restarts(view.links.thread).into(),
        Value::UsbErrors => uart::bus_errors(view.links.thread).into(),
        Value::AtCounter => encoder::at_counter(view.links.thread).into(),
        Value::Temperature(heater) => view.standing(heater).now.into(),
        Value::WantedTemperature(heater) => view.standing(heater).to.into(),
        Value::HeaterPower(heater) => i32::from(view.standing(heater).power) * 1_000 / 255,
        #[cfg(feature = "drivers")]
        Value::Driver(motor) => drivers::watch(view.links.thread, motor).state() as i32,
        #[cfg(feature = "drivers")]
        Value::DriverStatus(motor) => drivers::watch(view.links.thread, motor).status() as i32,
        #[cfg(feature = "sd")]
        Value::FileUse => super::card::file_use(view),
        #[cfg(feature = "sd")]
        Value::FileAt => super::card::progress(view).0,
        #[cfg(feature = "sd")]
        Value::FileLength => super::card::progress(view).1,
        Value::Kept => view.links.storage.is_done().into(),
        Value::Home => view.home_state(),
        Value::Door if !view.links.signs.door.get() => 0,
        Value::Door => 1 + i32::from(machine::is_resuming()),
        Value::Check => machine::is_checking().into(),
        Value::Blamed => view.links.model.borrow().blamed().into(),
        other => modal(view, other),
    }
}

/// Returns a value of the G-code model.
#[small]
pub(super) fn modal(view: &View<'_>, value: Value) -> i32 {
    let model = view.links.model.borrow();
    let modal = model.modal();
    match value {
        Value::Units => modal.units as i32,
        Value::Plane => modal.plane as i32,
        Value::Path => modal.path as i32,
        Value::Distance => modal.distance as i32,
        Value::ArcDistance => modal.arc_distance as i32,
        Value::SpindleOn => i32::from(modal.spindle != Turn::Off),
        Value::SpindleDirection => i32::from(modal.spindle == Turn::Counterclockwise),
        Value::SpindleSpeed => model.spindle_speed() as i32,
        Value::Mist => i32::from(modal.coolant & Coolant::Mist as u8 != 0),
        Value::Flood => i32::from(modal.coolant & Coolant::Flood as u8 != 0),
        Value::ToolOffset(axis) => {
            model.tool_length().get(usize::from(axis)).map_or(0, |length| length.0)
        }
        Value::FeedMode => modal.feed_mode as i32,
        Value::MotionMode => modal.motion as i32,
        Value::Coordinates => model.coordinate_system().into(),
        Value::Feed => thousandths(model.feed_rate()),
        Value::BlockLine => model.line() as i32,
        _ => 0,
    }
}
