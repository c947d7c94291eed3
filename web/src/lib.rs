//! Kerf in a page: the firmware's own tasks over `hal::host`, compiled to WebAssembly.
//!
//! An instance of the module is one machine. Its memory is the machine's: who wants another one, or this one after a reset, makes a new
//! instance. `web/page/firmware.js` calls what this file exports; nobody else does. Calls do not overlap, for a module runs in one
//! Worker.
//!
//! | part | is |
//! |---|---|
//! | [`mod@bench`] | the machine on its test bench: ports, clock, switches, spindle |
//! | [`mod@samples`] | where the motors were, at equal distances in time |
//! | [`mod@curves`] | velocity, acceleration and jerk, from those |
//! | [`mod@asked`] | which lines ask for more than the machine's limits allow |
//! | [`mod@tables`] | profiles and codes, as JSON |
//!
//! Bytes go in and out by two buffers: the page writes to [`input`] and says how many bytes are there; what a call returns as a length is at
//! [`output`]. A pointer is good until the next call, for memory may grow. Lengths beyond a buffer are cut to it. Before [`boot`]
//! everything else does nothing and returns 0. Units: ms of the machine's time, motor steps, mm and s in curves.
//!
//! Cost: a second of the machine's time takes 1 to 5 ms on a desktop computer.

pub mod asked;
pub mod bench;
pub mod curves;
pub mod samples;
pub mod tables;

use std::cell::RefCell;

use bench::Bench;
use curves::Curves;

/// What the page has made.
#[derive(Default)]
struct Page {
    input: Vec<u8>,
    output: Vec<u8>,
    bench: Option<Bench>,
    curves: Curves,
}

thread_local! {
    static PAGE: RefCell<Page> = RefCell::default();
}

fn page<R>(act: impl FnOnce(&mut Page) -> R) -> R {
    PAGE.with_borrow_mut(act)
}

/// Has `act` use the machine, if there is one.
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
}

/// Makes room for `len` bytes of input; where that is.
#[unsafe(no_mangle)]
pub extern "C" fn input(len: usize) -> *mut u8 {
    page(|page| {
        page.input.resize(len, 0);
        page.input.as_mut_ptr()
    })
}

/// Where the output of the last call is.
#[unsafe(no_mangle)]
pub extern "C" fn output() -> *const u8 {
    page(|page| page.output.as_ptr())
}

/// Makes the machine and boots the firmware. The input is what its EEPROM holds, nothing for a new one; `asked` if a reset was asked for. 1 if it
/// has booted; 0 for a second machine in an instance.
#[unsafe(no_mangle)]
pub extern "C" fn boot(len: usize, asked: u32) -> u32 {
    page(|page| {
        page.bench = page.bench.take().or_else(|| Bench::boot(page.given(len), asked != 0));
        page.bench.is_some().into()
    })
}

/// Puts the input on the line of a port, 0 or 1; the bytes take their time.
#[unsafe(no_mangle)]
pub extern "C" fn send(port: u32, len: usize) {
    page(|page| {
        if let Some(bench) = &page.bench {
            bench.send(port, page.given(len));
        }
    });
}

/// What the firmware has sent to a port since the last call.
#[unsafe(no_mangle)]
pub extern "C" fn heard(port: u32) -> usize {
    page(|page| {
        let heard = page.bench.as_mut().map(|bench| bench.heard(port)).unwrap_or_default();
        page.tell(heard)
    })
}

/// Runs for `ms`, less if it `stops` where the firmware has ended a line to the first port. How long it has run.
#[unsafe(no_mangle)]
pub extern "C" fn run(ms: u32, stops: u32) -> u32 {
    bench(|bench| bench.run(ms, stops != 0))
}

/// The state as numbers, see [`Bench::state`].
#[unsafe(no_mangle)]
pub extern "C" fn state() -> usize {
    page(|page| {
        let state = page.bench.as_ref().map(Bench::state).unwrap_or_default();
        page.tell(state.iter().flat_map(|number| number.to_le_bytes()).collect())
    })
}

/// What the EEPROM holds.
#[unsafe(no_mangle)]
pub extern "C" fn eeprom() -> usize {
    page(|page| {
        let bytes = page.bench.as_ref().map(Bench::eeprom).unwrap_or_default();
        page.tell(bytes)
    })
}

/// A contact closes or opens, see [`Bench::press`].
#[unsafe(no_mangle)]
pub extern "C" fn press(input: usize, closed: u32) {
    bench(|bench| bench.press(input, closed != 0));
}

/// A motor works a switch from now on, see [`Bench::near`].
#[unsafe(no_mangle)]
pub extern "C" fn near(input: usize, step: f64) {
    bench(|bench| bench.near(input, step as i64));
}

/// The spindle turns, see [`kerf::hal::imp::Machine::turn_spindle`].
#[unsafe(no_mangle)]
pub extern "C" fn spindle(rpm: f64, per_turn: u32) {
    bench(|bench| bench.turn_spindle(rpm, per_turn.min(400) as u16));
}

/// Begins to keep samples, the present place first; those before are dropped.
#[unsafe(no_mangle)]
pub extern "C" fn begin_samples() {
    bench(Bench::begin_samples);
}

/// The samples: four `i32` each, the steps of a motor.
#[unsafe(no_mangle)]
pub extern "C" fn samples() -> usize {
    page(|page| {
        let bytes = page.bench.as_ref().map(|bench| bench.samples().bytes()).unwrap_or_default();
        page.tell(bytes)
    })
}

/// Milliseconds between two samples.
#[unsafe(no_mangle)]
pub extern "C" fn sample_ms() -> u32 {
    bench(|bench| bench.samples().interval_ms())
}

/// Works out the curves of the samples. The input is four `f64`: millimetres of a step of each motor, 0 for one that does not count. Returns
/// the number of samples.
#[unsafe(no_mangle)]
pub extern "C" fn work_out_curves(len: usize) -> usize {
    page(|page| {
        let scale = numbers(page.given(len));
        let Some(bench) = &page.bench else { return 0 };
        page.curves = Curves::of(bench.samples(), scale);
        page.curves.velocity.len()
    })
}

/// A curve, `f32` each: 0 velocity, 1 acceleration, 2 jerk.
#[unsafe(no_mangle)]
pub extern "C" fn curve(which: u32) -> usize {
    page(|page| {
        let curve = match which {
            0 => &page.curves.velocity,
            1 => &page.curves.acceleration,
            _ => &page.curves.jerk,
        };
        let bytes = curve.iter().flat_map(|value| value.to_le_bytes()).collect();
        page.tell(bytes)
    })
}

/// How far the motors have been since the samples begin, and how far they have gone: the lowest, highest and all steps of each, `f64`.
#[unsafe(no_mangle)]
pub extern "C" fn extremes() -> usize {
    page(|page| {
        let numbers = page.bench.as_ref().map(Bench::extremes).unwrap_or_default();
        page.tell(numbers.iter().flat_map(|number| number.to_le_bytes()).collect())
    })
}

/// Which lines of a job ask for more than the limits allow, see [`asked::findings`]. The input is twelve `f64`, feed and rapid limits of six
/// axes, and the text behind them.
#[unsafe(no_mangle)]
pub extern "C" fn asked(len: usize) -> usize {
    page(|page| {
        let given = page.given(len);
        let (limits, text) = given.split_at_checked(96).unwrap_or((given, &[]));
        let findings = asked::findings(&String::from_utf8_lossy(text), &numbers(limits));
        page.tell(findings.into_bytes())
    })
}

/// Profiles, inputs and codes, see [`tables::json`].
#[unsafe(no_mangle)]
pub extern "C" fn tables() -> usize {
    page(|page| page.tell(tables::json().into_bytes()))
}

/// Numbers of the input; what is missing is 0.
fn numbers<const N: usize>(bytes: &[u8]) -> [f64; N] {
    let mut numbers = [0.0; N];
    for (number, bytes) in numbers.iter_mut().zip(bytes.chunks_exact(8)) {
        *number = f64::from_le_bytes(bytes.try_into().unwrap_or_default());
    }
    numbers
}
