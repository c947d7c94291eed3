//! The encoder of the spindle in thread mode: its settings, its speed, and pulses that do not fit.
//!
//! The power task calls [`look`] every 20 ms, which costs 1,500 cycles, or nothing without an encoder. The state is an
//! [`Encoder`](crate::encoder::Encoder) in `tasks::common`, under the ceiling. Nothing waits.

use kerf_macros::small;

use super::alarm;
use super::common;
use super::links::Links;
use super::storage::Storage;
use crate::boards::ACTIVE;
use crate::capability::Capability;
use crate::config::groups::spindle;
use crate::config::{Owner, Setting};
use crate::hal::event::Event;
use crate::hal::{Thread, encoder, flags};
use crate::machine::Alarm;
use crate::status::Status;

/// Microseconds in a count of time.
const COUNT_US: i32 = 4;

/// Whether a setting belongs to the encoder.
#[small]
pub fn is_own(setting: Setting) -> bool {
    setting.owner() == Owner::Spindle && setting.index() >= spindle::N
}

/// Takes over the settings of the encoder.
#[inline(never)]
#[small]
pub fn set_up(thread: Thread, storage: &Storage) {
    if !Capability::Lathe.is_built_in() {
        return;
    }
    let setting = |row| Setting::of(Owner::Spindle, row).map_or(0, |setting| storage.cold(setting));
    let (per_turn, bounce) = (setting(spindle::N) as u16, setting(spindle::B) / COUNT_US);
    let has_second = const {
        match ACTIVE.encoder {
            Some(encoder) => encoder.second.is_some(),
            None => false,
        }
    };
    let tells = has_second && per_turn > 1 && setting(spindle::DI) != 0;
    let lines = match per_turn {
        0 => 0,
        1 => 1,
        _ if tells => 7,
        _ => 3,
    };
    encoder::set_up(thread, lines, bounce as u16);
    let pulses = encoder::read();
    common::with(thread, |common| common.encoder.set_up(per_turn, tells, &pulses));
}

/// Reads the sensors of the encoder.
#[inline(never)]
#[small]
pub fn look(links: &Links) {
    if !Capability::Lathe.is_built_in() || encoder::in_use() == 0 {
        return;
    }
    // Another exception is reported first.
    let may_tell = links.notices.exception.get().is_none();
    let first_misfit = common::with(links.thread, |common| {
        // Under the lock, so that exec cannot have read newer pulses before. In a pass exec detects the misfits.
        common.encoder.sample(&encoder::read());
        may_tell && common.encoder.take_misfit()
    });
    // Tasks that wait for the spindle check again.
    flags::set(Event::BlockDone);
    if first_misfit {
        links.except(Status::PulseMisfit);
    }
    let waits_in_vain = common::with(links.thread, |common| {
        let waits = common.encoder.pass == Status::SpindleMustTurn;
        if waits {
            common.encoder.pass = Status::Again;
        }
        waits
    });
    if waits_in_vain {
        alarm::raise_for(links, Alarm::Alarm, Status::SpindleMustTurn);
    }
}

/// Returns the speed of the spindle, in thousandths of a turn a minute. Negative means backwards, if the encoder tells
/// the direction. `None` without an encoder.
#[small]
pub fn speed(thread: Thread) -> Option<i32> {
    if !Capability::Lathe.is_built_in() {
        return None;
    }
    common::with(thread, |common| {
        let encoder = &common.encoder;
        (encoder.per_turn() != 0).then(|| {
            let speed = encoder.speed() as i32;
            if encoder.turns_back() { -speed } else { speed }
        })
    })
}

/// Returns the status of the pass in step with the spindle ([`Encoder::pass`](crate::encoder::Encoder::pass)). A
/// refusal is returned once.
#[small]
pub fn pass(thread: Thread) -> Status {
    if !Capability::Lathe.is_built_in() {
        return Status::Ok;
    }
    common::with(thread, |common| {
        let pass = common.encoder.pass;
        if matches!(
            pass,
            Status::NoIndex | Status::NoSync | Status::WrongWay | Status::VelocityExceeded
        ) {
            common.encoder.pass = Status::Again;
        }
        pass
    })
}

/// Returns how far the axes are ahead of the spindle in the pass, um.
#[small]
pub fn error(thread: Thread) -> i16 {
    if !Capability::Lathe.is_built_in() {
        return 0;
    }
    common::with(thread, |common| common.encoder.error())
}

/// Whether the pass has come to another index pulse since the last call.
#[inline(never)]
#[small]
pub fn take_news(thread: Thread) -> bool {
    Capability::Lathe.is_built_in() && common::with(thread, |common| common.encoder.take_news())
}

/// Returns the pulses of the encoder in a turn; 0 without an encoder.
#[small]
pub fn per_turn(thread: Thread) -> u16 {
    if !Capability::Lathe.is_built_in() {
        return 0;
    }
    common::with(thread, |common| common.encoder.per_turn())
}

/// Returns how many pulses did not fit so far, 255 for more.
#[small]
pub fn misfits(thread: Thread) -> u8 {
    if !Capability::Lathe.is_built_in() {
        return 0;
    }
    common::with(thread, |common| common.encoder.misfits())
}
