//! The status report: `<Run|MPos:1.000,0.000,0.000|Bf:60,255|FS:800,0|WCO:0.000,0.000,0.000>`.
//!
//! The answer to `?`. A step writes one field, or one axis of a field. `WCO` comes at once after a change, otherwise
//! in every 10th report, or every 30th while the machine is not at rest. `Ov` comes at once after a change, otherwise
//! in every 10th report, or every 20th, and never together with `WCO`. `A`, the running spindle and coolant, comes
//! with `Ov`. The first report after a greeting has `WCO`, the second has `Ov`.

use super::settings;
use super::write::{int, length, speed, text};
use crate::boards::inputs;
use crate::capability::Capability;
use crate::gcode::overrides::Override;
use crate::machine::{Cycle, Doing};
use crate::progmem;
use crate::progmem::Text;
use crate::protocol::{Hold, Machine, Out, Remembers, Value};
use crate::text;

/// The number of reports from one `WCO` to the next, and from one `Ov` to the next, at rest.
const AT_REST: u8 = 10;
/// The number of reports from one `WCO` to the next, and from one `Ov` to the next, while the machine is not at rest.
const OFFSETS: u8 = 30;
const OVERRIDES: u8 = 20;

/// What is kept between reports. All ports share it.
pub struct Reports {
    /// The number of reports until the next `WCO`, and until the next `Ov`.
    offsets: u8,
    overrides: u8,
    /// A checksum of the offsets that were reported last.
    told: u16,
    /// A checksum of the overrides and accessories that were reported last.
    shown: u8,
    /// [`SLEEPS`] and [`LOWERED`], as bits.
    flags: u8,
}

/// A bit of [`Reports::flags`]: `$SLP` has put the machine to sleep.
pub(super) const SLEEPS: u8 = 1;
/// A bit of [`Reports::flags`]: a setting has lowered the maximum velocity of an axis.
pub(super) const LOWERED: u8 = 2;

#[small]
impl Reports {
    /// Sets or clears a flag. Returns whether it was set before.
    pub(super) fn note(&mut self, flag: u8, on: bool) -> bool {
        let before = self.flags & flag != 0;
        self.flags = if on { self.flags | flag } else { self.flags & !flag };
        before
    }
}

impl Remembers for Reports {
    fn new() -> Self {
        Self { offsets: 0, overrides: 0, told: 0, shown: 0, flags: 0 }
    }

    fn restore(&mut self) {
        self.refresh();
    }

    fn refresh(&mut self) {
        (self.offsets, self.overrides) = (0, 0);
    }
}

/// A report that is being written. The default has not begun.
#[derive(Default)]
pub struct Report {
    field: Field,
    axis: u8,
    axes: u8,
    inches: bool,
    /// Whether the report has `WCO`, and whether it has `Ov`.
    with: (bool, bool),
}

#[derive(Clone, Copy, Default, PartialEq, Eq)]
enum Field {
    #[default]
    State,
    Position,
    Buffers,
    Feed,
    Offset,
    Overrides,
    Accessories,
    Pins,
    Sync,
    File,
    Done,
}

#[small]
impl Report {
    /// Starts a report on the present state of the machine.
    #[inline(never)]
    fn begin(machine: &mut impl Machine) -> Self {
        let axes = settings::axes(machine);
        let inches = settings::inches(machine);
        let sum = offsets(machine, axes);
        let moves = machine.doing() != Doing::Rests;
        let shown = accessories_sum(machine);
        let reports = &mut machine.memory().grbl;
        if reports.shown != shown {
            (reports.shown, reports.overrides) = (shown, 0);
        }
        let due = reports.offsets == 0 || reports.told != sum;
        let mut with = (false, false);
        if due {
            with.0 = true;
            reports.told = sum;
            reports.offsets = if moves { OFFSETS } else { AT_REST };
        } else if reports.overrides == 0 {
            with.1 = true;
            reports.overrides = if moves { OVERRIDES } else { AT_REST };
        }
        reports.offsets = reports.offsets.saturating_sub(1);
        reports.overrides = reports.overrides.saturating_sub(1);
        Self { field: Field::State, axis: 0, axes, inches, with }
    }

    /// Writes the next part. Returns whether there is more.
    #[inline(never)]
    pub fn step(&mut self, machine: &mut impl Machine, out: &mut impl Out) -> bool {
        machine.moment(self.field == Field::State);
        match self.field {
            Field::State => {
                *self = Self::begin(machine);
                out.put(b'<');
                state(machine, out);
                self.field = Field::Position;
            }
            Field::Position => {
                let work = !machine.settings().reports_machine_position();
                let name = if work { text!("|WPos:") } else { text!("|MPos:") };
                let axis = self.axis;
                let value = if work { Value::Position(axis) } else { Value::MachinePosition(axis) };
                self.coordinate(name, value, Field::Buffers, machine, out);
            }
            Field::Buffers => {
                if machine.settings().reports_buffers() {
                    text(out, text!("|Bf:"));
                    int(out, machine.value(Value::BlocksFree));
                    out.put(b',');
                    int(out, machine.value(Value::BytesFree));
                }
                let line = machine.value(Value::MotionLine);
                if line != 0 && machine.value(Value::Running) != 0 {
                    text(out, text!("|Ln:"));
                    int(out, line);
                }
                self.field = Field::Feed;
            }
            Field::Feed => {
                text(out, text!("|FS:"));
                speed(out, machine.value(Value::Velocity), self.inches);
                out.put(b',');
                // The measured speed of an encoder counts, even while the spindle is not programmed to turn.
                let measures =
                    Capability::Lathe.is_built_in() && machine.value(Value::PulsesPerTurn) != 0;
                let on = measures || machine.value(Value::SpindleOn) != 0;
                int(out, if on { turns(machine, measures) } else { 0 });
                self.field = Field::Offset;
            }
            Field::Offset if self.with.0 => {
                let value = Value::Offset(self.axis);
                self.coordinate(text!("|WCO:"), value, Field::Overrides, machine, out);
            }
            Field::Offset => self.field = Field::Overrides,
            Field::Overrides => {
                if self.with.1 {
                    overrides(machine, out);
                }
                self.field = Field::Accessories;
            }
            Field::Accessories => {
                if self.with.1 {
                    accessories(machine, out);
                }
                self.field = Field::Pins;
            }
            Field::Pins => {
                pins(machine, out);
                self.field = Field::Sync;
            }
            Field::Sync => {
                if Capability::Lathe.is_built_in() && machine.value(Value::PulsesPerTurn) != 0 {
                    text(out, text!("|Se:"));
                    reported_error(machine, out);
                }
                self.field = Field::File;
            }
            Field::File => {
                #[cfg(feature = "sd")]
                super::card::field(machine, out);
                out.put(b'>');
                super::write::line_end(out);
                self.field = Field::Done;
            }
            Field::Done => return false,
        }
        self.field != Field::Done
    }

    /// Writes one axis of a vector, and the name of the field before the first axis.
    #[inline(never)]
    fn coordinate(
        &mut self,
        name: Text,
        value: Value,
        next: Field,
        machine: &mut impl Machine,
        out: &mut impl Out,
    ) {
        if self.axis == 0 {
            text(out, name);
        } else {
            out.put(b',');
        }
        length(out, machine.value(value), self.inches && self.axis < 3);
        self.axis += 1;
        if self.axis >= self.axes {
            (self.axis, self.field) = (0, next);
        }
    }
}

/// Writes how far the axes of a pass are ahead of the spindle, measured at the last index pulse.
#[inline(never)]
#[small]
pub(super) fn sync_error(machine: &mut impl Machine, out: &mut impl Out) {
    let inches = settings::inches(machine);
    // From um to the unit of a `Length`.
    length(out, machine.value(Value::SyncError) * 10, inches);
}

/// Writes how far the axes of a thread are ahead of the spindle. `0.00` between passes, and if the report mask does
/// not enable it.
#[inline(never)]
#[small]
fn reported_error(machine: &mut impl Machine, out: &mut impl Out) {
    let error = machine.value(Value::SyncError);
    if error != 0 && machine.settings().reports_sync_error() {
        sync_error(machine, out);
    } else {
        text(out, text!("0.00"));
    }
}

/// Returns the speed of the spindle, in turns per minute.
#[small]
pub(super) fn rpm(machine: &mut impl Machine) -> i32 {
    (machine.value(Value::SpindleSpeed).abs() + 500) / 1_000
}

/// Returns the speed of the spindle that is on: as measured, or as programmed and overridden.
#[small]
fn turns(machine: &mut impl Machine, measures: bool) -> i32 {
    let speed = rpm(machine);
    match machine.value(Value::Override(Override::Spindle)) {
        _ if measures => speed,
        // At most 2,000, so that the product fits.
        factor => speed.min(1_000_000) * factor / 1_000,
    }
}

/// Returns a checksum of the offsets, which changes with them.
#[small]
fn offsets(machine: &mut impl Machine, axes: u8) -> u16 {
    let mut sum = 1u16;
    for axis in 0..axes {
        let value = machine.value(Value::Offset(axis)) as u32;
        sum = sum.rotate_left(5) ^ value as u16 ^ (value >> 16) as u16;
    }
    sum
}

/// Returns a checksum of the overrides, the spindle and the coolant, which changes with them.
#[inline(never)]
#[small]
fn accessories_sum(machine: &mut impl Machine) -> u8 {
    let mut sum = 1u8;
    let mut add = |value| {
        let value: i32 = machine.value(value);
        sum = sum.rotate_left(3) ^ value as u8 ^ (value >> 8) as u8;
    };
    add(Value::Override(Override::Feed));
    add(Value::Override(Override::Traverse));
    add(Value::Override(Override::Spindle));
    add(Value::SpindleOn);
    add(Value::SpindleDirection);
    add(Value::Flood);
    add(Value::Mist);
    sum
}

/// The [`Value::Door`] of a machine that resumes after a door.
const RESUMES: i32 = 2;

/// Writes the state of the machine, in grbl's words.
#[inline(never)]
#[small]
fn state(machine: &mut impl Machine, out: &mut impl Out) {
    let (doing, rests) = (machine.doing(), machine.hold() == Hold::Rests);
    if !matches!(doing, Doing::Alarm(_)) {
        // A sender on another port may have ended the alarm.
        machine.memory().grbl.note(SLEEPS, false);
    }
    let sleeps = machine.memory().grbl.flags & SLEEPS != 0;
    let door = machine.value(Value::Door);
    let stopped = machine.cycle() == Cycle::Stopped;
    let checks = machine.value(Value::Check) != 0;
    text(
        out,
        match doing {
            _ if sleeps => text!("Sleep"),
            Doing::Alarm(_) => text!("Alarm"),
            Doing::Door if rests => text!("Door:1"),
            Doing::Holds if door == RESUMES => text!("Door:3"),
            Doing::Holds if door != 0 && rests => text!("Door:0"),
            Doing::Door => text!("Door:2"),
            Doing::Holds if door != 0 => text!("Door:2"),
            Doing::Holds if rests => text!("Hold:0"),
            Doing::Holds => text!("Hold:1"),
            // A program stop waits for cycle start, so it is shown as a hold.
            _ if stopped => text!("Hold:0"),
            Doing::Homes => text!("Home"),
            Doing::Jogs => text!("Jog"),
            Doing::Runs | Doing::Probes => text!("Run"),
            Doing::Rests if checks => text!("Check"),
            Doing::Rests => text!("Idle"),
        },
    );
}

#[small]
fn overrides(machine: &mut impl Machine, out: &mut impl Out) {
    let mut factor = |name, which| {
        text(out, name);
        int(out, (machine.value(Value::Override(which)) + 5) / 10);
    };
    factor(text!("|Ov:"), Override::Feed);
    factor(text!(","), Override::Traverse);
    factor(text!(","), Override::Spindle);
}

/// Writes the running accessories, if there are any.
#[small]
fn accessories(machine: &mut impl Machine, out: &mut impl Out) {
    let mut begun = false;
    if machine.value(Value::SpindleOn) != 0 {
        let counter = machine.value(Value::SpindleDirection) != 0;
        letter(text!("|A:"), &mut begun, if counter { b'C' } else { b'S' }, out);
    }
    if machine.value(Value::Flood) != 0 {
        letter(text!("|A:"), &mut begun, b'F', out);
    }
    if machine.value(Value::Mist) != 0 {
        letter(text!("|A:"), &mut begun, b'M', out);
    }
}

progmem! {
    /// The inputs, and grbl's letters for them in the order of the report.
    static PINS: [(u8, u8); 11] = [
        (inputs::PROBE as u8, b'P'),
        (inputs::X_MIN as u8, b'X'), (inputs::X_MAX as u8, b'X'),
        (inputs::Y_MIN as u8, b'Y'), (inputs::Y_MAX as u8, b'Y'),
        (inputs::Z_MIN as u8, b'Z'), (inputs::Z_MAX as u8, b'Z'),
        (inputs::A_MIN as u8, b'A'), (inputs::A_MAX as u8, b'A'),
        (inputs::DOOR as u8, b'D'), (inputs::STOP as u8, b'R'),
    ];
}

/// Writes the actuated switches, if there are any.
#[small]
fn pins(machine: &mut impl Machine, out: &mut impl Out) {
    let (mut begun, mut last) = (false, 0);
    let mut row = 0;
    while let Some((input, name)) = PINS.at(row) {
        row += 1;
        if name != last && machine.value(Value::Input(input)) == 1 {
            last = name;
            letter(text!("|Pn:"), &mut begun, name, out);
        }
    }
}

/// Writes a letter, and the name of the field before the first one.
#[inline(never)]
fn letter(name: Text, begun: &mut bool, letter: u8, out: &mut impl Out) {
    if !core::mem::replace(begun, true) {
        text(out, name);
    }
    out.put(letter);
}
