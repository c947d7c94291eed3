//! The firmware in a web page: its own tasks over `hal::host`, compiled to WebAssembly.
//!
//! One instance of the module is one machine, and the instance's memory is the machine's memory. A second machine, or
//! this machine after a reset, needs a new instance. Only `web/page/firmware.js` calls the functions that this file
//! exports. Calls do not overlap, because a module runs in one Worker.
//!
//! | part | contents |
//! |---|---|
//! | [`mod@bench`] | the simulated machine: ports, clock, switches, spindle |
//! | [`mod@samples`] | the positions of the motors at equal intervals |
//! | [`mod@curves`], [`mod@windows`] | velocity, acceleration and jerk, computed from the samples |
//! | [`mod@asked`] | the lines that ask for more than the machine's limits allow |
//! | [`mod@tables`] | profiles and codes, as JSON |
//! | [`mod@verify`] | the checks of a real board, for which no machine is needed |
//!
//! Bytes pass through two buffers. The page writes to [`input`] and passes the number of bytes. A call whose result is
//! a length has written its output to [`output`]. A pointer is valid until the next call, because memory may grow.
//! Lengths beyond a buffer are cut to it. Before [`boot`] the functions of a machine do nothing and return 0. Units: ms
//! of the machine's time, motor steps; mm and s in curves.
//!
//! Cost: a second of the machine's time takes 1 to 5 ms on a desktop computer.

pub mod asked;
pub mod bench;
pub mod card;
pub mod curves;
pub mod samples;
pub mod tables;
pub mod verify;
pub mod windows;

use std::cell::RefCell;
use std::time::Duration;

use bench::Bench;
use curves::Quantity;
use kerf_verify::dialect::{GRBL, TINYG};
use verify::{Verification, Want};

/// The state of the module.
#[derive(Default)]
struct Page {
    input: Vec<u8>,
    output: Vec<u8>,
    bench: Option<Bench>,
    verification: Option<Verification>,
}

thread_local! {
    static PAGE: RefCell<Page> = RefCell::default();
}

fn page<R>(act: impl FnOnce(&mut Page) -> R) -> R {
    PAGE.with_borrow_mut(act)
}

/// Calls `act` with the machine, if there is one; else returns the default.
fn bench<R: Default>(act: impl FnOnce(&mut Bench) -> R) -> R {
    page(|page| page.bench.as_mut().map(act).unwrap_or_default())
}

impl Page {
    fn given(&self, len: usize) -> &[u8] {
        self.input.get(..len).unwrap_or(&self.input)
    }

    fn tell(&mut self, bytes: Vec<u8>) -> usize {
        self.output = bytes;
        self.output.len()
    }

    fn tell_floats(&mut self, floats: &[f32]) -> usize {
        self.tell(floats.iter().flat_map(|value| value.to_le_bytes()).collect())
    }
}

/// Makes room for `len` bytes of input, and returns its address.
#[unsafe(no_mangle)]
pub extern "C" fn input(len: usize) -> *mut u8 {
    page(|page| {
        page.input.resize(len, 0);
        page.input.as_mut_ptr()
    })
}

/// Returns the address of the output of the last call.
#[unsafe(no_mangle)]
pub extern "C" fn output() -> *const u8 {
    page(|page| page.output.as_ptr())
}

/// Creates the machine and boots the firmware. The input is the EEPROM contents, empty for a new machine. `asked` is 1
/// if the firmware has asked for the reset. Returns 1 if it has booted, 0 for a second machine in an instance.
#[unsafe(no_mangle)]
pub extern "C" fn boot(len: usize, asked: u32) -> u32 {
    page(|page| {
        page.bench = page.bench.take().or_else(|| Bench::boot(page.given(len), asked != 0));
        page.bench.is_some().into()
    })
}

/// Puts the input on the line of a port, 0 or 1. The bytes arrive at the rate of the line.
#[unsafe(no_mangle)]
pub extern "C" fn send(port: u32, len: usize) {
    page(|page| {
        if let Some(bench) = &page.bench {
            bench.send(port, page.given(len));
        }
    });
}

/// Writes to the output what the firmware has sent on a port since the last call. Returns its length.
#[unsafe(no_mangle)]
pub extern "C" fn heard(port: u32) -> usize {
    page(|page| {
        let heard = page.bench.as_mut().map(|bench| bench.heard(port)).unwrap_or_default();
        page.tell(heard)
    })
}

/// Runs for `ms` milliseconds, or less: see [`Bench::run`]. Returns the milliseconds that have passed.
#[unsafe(no_mangle)]
pub extern "C" fn run(ms: u32, stops: u32) -> u32 {
    bench(|bench| bench.run(ms, stops != 0))
}

/// Writes the state as numbers, see [`Bench::state`]. Returns the length.
#[unsafe(no_mangle)]
pub extern "C" fn state() -> usize {
    page(|page| {
        let state = page.bench.as_ref().map(Bench::state).unwrap_or_default();
        page.tell(state.iter().flat_map(|number| number.to_le_bytes()).collect())
    })
}

/// Writes the EEPROM contents. Returns the length.
#[unsafe(no_mangle)]
pub extern "C" fn eeprom() -> usize {
    page(|page| {
        let bytes = page.bench.as_ref().map(Bench::eeprom).unwrap_or_default();
        page.tell(bytes)
    })
}

/// Closes or opens a contact, see [`Bench::press`].
#[unsafe(no_mangle)]
pub extern "C" fn press(input: usize, closed: u32) {
    bench(|bench| bench.press(input, closed != 0));
}

/// Makes a motor actuate a switch from now on, see [`Bench::near`].
#[unsafe(no_mangle)]
pub extern "C" fn near(input: usize, step: f64) {
    bench(|bench| bench.near(input, step as i64));
}

/// Turns the spindle, see [`kerf::hal::imp::Machine::turn_spindle`].
#[unsafe(no_mangle)]
pub extern "C" fn spindle(rpm: f64, per_turn: u32) {
    bench(|bench| bench.turn_spindle(rpm, per_turn.min(400) as u16));
}

/// Begins to keep samples. The first one is the present position; earlier samples are dropped.
#[unsafe(no_mangle)]
pub extern "C" fn begin_samples() {
    bench(Bench::begin_samples);
}

/// Writes the samples: for each, the steps of the motors, an `i32` each. Returns the length.
#[unsafe(no_mangle)]
pub extern "C" fn samples() -> usize {
    page(|page| {
        let bytes = page.bench.as_ref().map(|bench| bench.samples().bytes()).unwrap_or_default();
        page.tell(bytes)
    })
}

/// Returns the milliseconds between two samples.
#[unsafe(no_mangle)]
pub extern "C" fn sample_ms() -> u32 {
    bench(|bench| bench.samples().interval_ms())
}

/// Returns the time between positions from which accelerations are computed, ms; velocity and jerk have twice as much.
#[unsafe(no_mangle)]
pub extern "C" fn window_ms() -> f64 {
    bench(|bench| 1e3 * curves::windows(bench.samples()).seconds())
}

/// Writes the speed along the path, an `f32` for each sample. The input is one `f64` for each motor: the length of a
/// step, mm; 0 for a motor that does not count. Returns the length.
#[unsafe(no_mangle)]
pub extern "C" fn speed(len: usize) -> usize {
    page(|page| {
        let scale = numbers(page.given(len));
        let speed = page.bench.as_ref().map(|bench| curves::speed(bench.samples(), scale));
        page.tell_floats(&speed.unwrap_or_default())
    })
}

/// Writes a curve of a motor whose steps have a length of `mm`, an `f32` for each sample: 0 velocity, 1 acceleration, 2
/// jerk. Returns the length.
#[unsafe(no_mangle)]
pub extern "C" fn curve(which: u32, motor: usize, mm: f64) -> usize {
    let quantity = match which {
        0 => Quantity::Velocity,
        1 => Quantity::Acceleration,
        _ => Quantity::Jerk,
    };
    page(|page| {
        let bench = page.bench.as_ref();
        let curve = bench.map(|bench| curves::curve(bench.samples(), quantity, motor, mm));
        page.tell_floats(&curve.unwrap_or_default())
    })
}

/// Writes the lowest and the highest position and the number of steps of each motor since the samples began, as `f64`.
/// Returns the length.
#[unsafe(no_mangle)]
pub extern "C" fn extremes() -> usize {
    page(|page| {
        let numbers = page.bench.as_ref().map(Bench::extremes).unwrap_or_default();
        page.tell(numbers.iter().flat_map(|number| number.to_le_bytes()).collect())
    })
}

/// Writes the lines of a job that ask for more than the limits allow, see [`asked::findings`]. The input is twelve
/// `f64`, the feed limits and the velocity limits of six axes, and then the text of the job. Returns the length.
#[unsafe(no_mangle)]
pub extern "C" fn asked(len: usize) -> usize {
    page(|page| {
        let given = page.given(len);
        let (limits, text) = given.split_at_checked(96).unwrap_or((given, &[]));
        let findings = asked::findings(&String::from_utf8_lossy(text), &numbers(limits));
        page.tell(findings.into_bytes())
    })
}

/// Writes the profiles and codes, see [`tables::json`]. Returns the length.
#[unsafe(no_mangle)]
pub extern "C" fn tables() -> usize {
    page(|page| page.tell(tables::json().into_bytes()))
}

/// Prepares the checks of a real board, in grbl's dialect if `grbl` is 1, else in TinyG's. `seed` chooses the values
/// that are stored.
#[unsafe(no_mangle)]
pub extern "C" fn verify_begin(grbl: u32, seed: f64) {
    let dialect = if grbl != 0 { &GRBL } else { &TINYG };
    page(|page| page.verification = Some(Verification::new(dialect, seed as u64)));
}

/// Goes on with the checks, see [`Verification::step`]. The time is in ms, the input is what the board has sent. Writes
/// what is wanted next, see [`Want::bytes`]. Returns the length; 0 if nothing is wanted any more.
#[unsafe(no_mangle)]
pub extern "C" fn verify_step(ms: f64, len: usize) -> usize {
    page(|page| {
        let now = Duration::try_from_secs_f64(ms / 1e3).unwrap_or_default();
        let Page { input, verification, .. } = page;
        let heard = input.get(..len).unwrap_or(input);
        let want = verification.as_mut().and_then(|checks| checks.step(now, heard));
        page.tell(want.map(Want::bytes).unwrap_or_default())
    })
}

/// Tells the checks that the port does not work any more. The input says why.
#[unsafe(no_mangle)]
pub extern "C" fn verify_fail(len: usize) {
    page(|page| {
        let why = String::from_utf8_lossy(page.given(len)).into_owned();
        if let Some(checks) = &mut page.verification {
            checks.fail(&why);
        }
    });
}

/// Returns the numbers of the input; 0 for missing ones.
fn numbers<const N: usize>(bytes: &[u8]) -> [f64; N] {
    let mut numbers = [0.0; N];
    for (number, bytes) in numbers.iter_mut().zip(bytes.chunks_exact(8)) {
        *number = f64::from_le_bytes(bytes.try_into().unwrap_or_default());
    }
    numbers
}
