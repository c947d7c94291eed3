//! State that exec and thread mode both change: the motion snapshot, the overrides, the powered motors, the outputs.
//!
//! Exec holds the state, by its [end](avr_embassy::InterruptEnd), while it does one step. All others use the state with
//! exec locked out ([`with`]). The operations on its parts are in `overrides`, `power` and `spindle`.

use crate::encoder::Encoder;
use crate::gcode::overrides::Overrides;
use crate::hal::exec;
use crate::hal::{Exclusive, Thread};
use crate::heat::{Orders, PRINTERS};
use crate::motion::snapshot::Snapshot;
use crate::motors::Motors;
use crate::spindle::Spindle;

/// The state: see the module's text.
pub struct State {
    /// The motion snapshot. Exec changes it, all others read it.
    pub motion: Snapshot,
    /// The overrides in force.
    pub overrides: Overrides,
    /// Which motors have power.
    pub motors: Motors,
    /// Settings and override of the outputs.
    pub spindle: Spindle,
    /// The state of the spindle's encoder.
    pub encoder: Encoder,
    /// The targets of heaters, in an image that has heaters.
    pub heat: [Orders; PRINTERS],
}

avr_embassy::shared_static! {
    /// Where the state is.
    ///
    /// The state cannot be accessed without the lock:
    ///
    /// ```compile_fail,E0061
    /// use kerf::tasks::common::Common;
    ///
    /// let running = Common.with(|state| state.motion.running);
    /// ```
    ///
    /// and thread mode does not get exec's end:
    ///
    /// ```compile_fail,E0308
    /// fn steal(thread: kerf::hal::Thread) {
    ///     avr_embassy::InterruptEnd::of(kerf::tasks::common::Common, thread);
    /// }
    /// ```
    pub struct Common: State = State {
        motion: Snapshot::new(),
        overrides: Overrides::NONE,
        motors: Motors::new(),
        spindle: Spindle::new(),
        encoder: Encoder::new(),
        heat: [Orders::OFF; PRINTERS],
    };
}

/// Calls `act` on the state while exec cannot run.
#[inline(always)]
pub fn with<R>(thread: Thread, act: impl FnOnce(&mut State) -> R + Send) -> R {
    exec::lock(thread, |ceiling| Common.with(ceiling, act))
}

/// As [`with`], for what switches outputs besides: `act` also gets the proof that exec cannot run.
#[inline(always)]
pub fn with_outputs<R>(
    thread: Thread,
    act: impl FnOnce(&mut State, Exclusive<'_>) -> R + Send,
) -> R {
    exec::lock(thread, |ceiling| {
        let alone = ceiling.exclusive();
        Common.with(ceiling, move |state| act(state, alone))
    })
}

/// Returns the motion snapshot.
pub fn snapshot(thread: Thread) -> Snapshot {
    with(thread, |common| common.motion)
}
