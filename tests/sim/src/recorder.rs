//! Records the step and direction pins.

use std::ffi::c_void;
use std::ptr::NonNull;

use kerf::boards::{Board, MOTORS, Pin};
use simavr_ffi as ffi;

use crate::bus::Bus;
use crate::cpu::Cpu;
use crate::mechanics::SpindlePin;
use crate::pauses::{Found, Meter, Scale};
use crate::trace::Trace;

/// A step: its time, its motor (0 is motor 1) and its direction.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Step {
    /// Cycle at which the pulse begins.
    pub cycle: u64,
    /// Motor, counted from 0.
    pub motor: u8,
    /// Whether the direction pin is low.
    pub positive: bool,
}

/// Running totals at the moment of a step.
#[derive(Clone, Copy, Default, Debug)]
pub struct Sums {
    /// Cycles asleep.
    pub asleep: u64,
    /// Cycles inside interrupts, nested ones counted once.
    pub in_interrupts: u64,
}

/// The record of one motor. Times are in cycles.
#[derive(Clone, Debug)]
pub struct Motor {
    /// Steps up minus steps down; a low direction pin is up.
    pub position: i64,
    /// Steps in both directions together.
    pub steps: u64,
    /// Shortest time between two steps.
    pub min_interval: Option<u64>,
    /// Shortest and longest pulse.
    pub pulse: Option<(u64, u64)>,
    /// Shortest time from a change of direction to the next step.
    pub min_setup: Option<u64>,
    /// Whether the motor steps on a falling edge, so that the pin rests high.
    active_low: bool,
    step_high: bool,
    dir_high: bool,
    rose_at: Option<u64>,
    turned_at: Option<u64>,
}

impl Motor {
    fn new() -> Self {
        Motor {
            position: 0,
            steps: 0,
            min_interval: None,
            pulse: None,
            min_setup: None,
            active_low: false,
            step_high: false,
            dir_high: false,
            rose_at: None,
            turned_at: None,
        }
    }

    fn begin_pulse(&mut self, now: u64) {
        self.position += if self.dir_high { -1 } else { 1 };
        self.steps += 1;
        if let Some(before) = self.rose_at {
            least(&mut self.min_interval, now - before);
        }
        if let Some(turned) = self.turned_at.take() {
            least(&mut self.min_setup, now - turned);
        }
        self.rose_at = Some(now);
    }

    fn end_pulse(&mut self, now: u64) {
        if let Some(rose) = self.rose_at {
            let width = now - rose;
            let (low, high) = self.pulse.unwrap_or((width, width));
            self.pulse = Some((low.min(width), high.max(width)));
        }
    }
}

fn least(slot: &mut Option<u64>, value: u64) {
    *slot = Some(slot.map_or(value, |v| v.min(value)));
}

/// Records the four motors of a board.
pub struct Recorder {
    motors: [Motor; MOTORS],
    first: Option<(u64, Sums)>,
    last: Option<(u64, Sums)>,
    log: Option<Vec<Step>>,
    runs: Vec<(u64, u64)>,
    trace: Option<Trace>,
    pauses: Option<Meter>,
}

impl Recorder {
    pub(crate) fn new() -> Self {
        Recorder {
            motors: std::array::from_fn(|_| Motor::new()),
            first: None,
            last: None,
            log: None,
            runs: Vec::new(),
            trace: None,
            pauses: None,
        }
    }

    /// The motors, motor 1 first.
    pub fn motors(&self) -> &[Motor; MOTORS] {
        &self.motors
    }

    /// Number of steps of all motors.
    pub fn steps(&self) -> u64 {
        self.motors.iter().map(|m| m.steps).sum()
    }

    /// Cycle of the first and of the last step, with the running totals at each.
    pub fn span(&self) -> Option<((u64, Sums), (u64, Sums))> {
        self.first.zip(self.last)
    }

    /// Cycle of the last step.
    pub fn last_step(&self) -> Option<u64> {
        self.last.map(|(cycle, _)| cycle)
    }

    /// Keeps every step from now on.
    pub fn keep_log(&mut self) {
        self.log = Some(Vec::new());
    }

    /// Returns the steps that were kept.
    pub fn log(&self) -> &[Step] {
        self.log.as_deref().unwrap_or_default()
    }

    /// Returns the cycles of a motor's steps, among the steps that were kept.
    pub fn steps_of(&self, motor: u8) -> Vec<u64> {
        self.log().iter().filter(|s| s.motor == motor).map(|s| s.cycle).collect()
    }

    /// Detects pauses from now on. The motors must stand still.
    pub fn meter_pauses(&mut self, scale: Scale) {
        self.pauses = Some(Meter::new(scale));
    }

    /// Returns the pauses found; none if `meter_pauses` was not called.
    pub fn pauses(&self) -> Found {
        self.pauses.as_ref().map(Meter::found).unwrap_or_default()
    }

    /// The runs of the step timer, from cycle to cycle, while steps were kept. A run that has not ended ends at
    /// [`u64::MAX`].
    pub fn timer_runs(&self) -> &[(u64, u64)] {
        &self.runs
    }

    /// Takes note that the step timer was started or stopped.
    pub(crate) fn timer(&mut self, runs: bool, now: u64) {
        if self.log.is_some() && runs {
            self.runs.push((now, u64::MAX));
        } else if let Some(run) = self.runs.last_mut() {
            run.1 = run.1.min(now);
        }
        if let Some(meter) = &mut self.pauses {
            meter.timer(runs);
        }
    }

    pub(crate) fn set_trace(&mut self, trace: Option<Trace>) -> Option<Trace> {
        std::mem::replace(&mut self.trace, trace)
    }

    /// Clears everything except the levels of the pins.
    pub fn clear(&mut self) {
        for m in &mut self.motors {
            let Motor { active_low, step_high, dir_high, .. } = *m;
            *m = Motor { active_low, step_high, dir_high, ..Motor::new() };
        }
        (self.first, self.last) = (None, None);
        self.runs.clear();
        if let Some(log) = &mut self.log {
            log.clear();
        }
    }

    /// Sets which motors step on a falling edge from now on, as bits.
    pub fn set_active_low(&mut self, motors: u8) {
        for (bit, m) in self.motors.iter_mut().enumerate() {
            m.active_low = motors & 1 << bit != 0;
        }
    }

    /// Takes note of a reset, which makes all pins inputs; the drivers see low levels.
    pub(crate) fn pins_released(&mut self) {
        for m in &mut self.motors {
            (m.step_high, m.dir_high) = (false, false);
        }
    }

    /// Takes an edge of a step pin. If it is a step, returns whether the step is upwards; else `None`.
    fn step_edge(&mut self, motor: usize, high: bool, now: u64, sums: Sums) -> Option<bool> {
        let m = &mut self.motors[motor];
        if m.step_high == high {
            return None;
        }
        m.step_high = high;
        let positive = !m.dir_high;
        let steps = high != m.active_low;
        if steps {
            m.begin_pulse(now);
            self.first.get_or_insert((now, sums));
            self.last = Some((now, sums));
            let step = Step { cycle: now, motor: motor as u8, positive };
            if let Some(log) = &mut self.log {
                log.push(step);
            }
            if let Some(meter) = &mut self.pauses {
                meter.step(step);
            }
        } else {
            m.end_pulse(now);
        }
        if let Some(trace) = &mut self.trace {
            trace.step(motor, high, positive, now);
        }
        steps.then_some(positive)
    }

    fn dir_edge(&mut self, motor: usize, high: bool, now: u64) {
        let m = &mut self.motors[motor];
        if m.dir_high == high {
            return;
        }
        m.dir_high = high;
        m.turned_at = Some(now);
        if let Some(trace) = &mut self.trace {
            trace.dir(motor, high, now);
        }
    }
}

/// The data of a pin's callback.
pub(crate) struct Probe {
    bus: NonNull<Bus>,
    what: What,
}

/// The function of an output.
#[derive(Clone, Copy)]
enum What {
    Step(usize),
    Dir(usize),
    Spindle(SpindlePin),
    /// Selects a device on SPI.
    Select(Pin),
    /// Is connected with an input.
    Input(Pin),
    /// Is connected with the external clock of a timer.
    Clock(usize),
}

/// Listens to the motors' pins of a board. The probes must live as long as the CPU.
pub(crate) fn attach(bus: NonNull<Bus>, cpu: Cpu, board: &Board) -> Vec<Probe> {
    let motors = board.motors.iter().enumerate();
    let pins = motors.flat_map(|(m, pins)| [(pins.step, What::Step(m)), (pins.dir, What::Dir(m))]);
    watch(bus, cpu, &pins.collect::<Vec<_>>())
}

/// Listens to the spindle's pins. `pulse` is the pin of its pulse-width drive, if there is one. The probes must live as
/// long as the CPU.
pub(crate) fn attach_spindle(
    bus: NonNull<Bus>,
    cpu: Cpu,
    board: &Board,
    pulse: Option<Pin>,
) -> Vec<Probe> {
    let [enable, reverse, ..] = board.outputs;
    let pins =
        [(enable, SpindlePin::Enable), (reverse, SpindlePin::Reverse), (pulse, SpindlePin::Pulse)];
    let pins = pins.into_iter().filter_map(|(pin, what)| Some((pin?, What::Spindle(what))));
    watch(bus, cpu, &pins.collect::<Vec<_>>())
}

/// Listens to a pin that selects a device on SPI. The probes must live as long as the CPU.
pub(crate) fn attach_select(bus: NonNull<Bus>, cpu: Cpu, pin: Pin) -> Vec<Probe> {
    watch(bus, cpu, &[(pin, What::Select(pin))])
}

/// Connects an output with an input. The probes must live as long as the CPU.
pub(crate) fn attach_input(bus: NonNull<Bus>, cpu: Cpu, from: Pin, to: Pin) -> Vec<Probe> {
    watch(bus, cpu, &[(from, What::Input(to))])
}

/// Connects an output with the external clock of a timer. The probes must live as long as the CPU.
pub(crate) fn attach_clock(bus: NonNull<Bus>, cpu: Cpu, from: Pin, timer: usize) -> Vec<Probe> {
    watch(bus, cpu, &[(from, What::Clock(timer))])
}

fn watch(bus: NonNull<Bus>, cpu: Cpu, pins: &[(Pin, What)]) -> Vec<Probe> {
    let mut probes: Vec<Probe> = pins.iter().map(|(_, what)| Probe { bus, what: *what }).collect();
    for (probe, (pin, _)) in probes.iter_mut().zip(pins) {
        let param = (&raw mut *probe).cast::<c_void>();
        cpu.watch_pin(pin.port.letter(), pin.bit, Some(pin_changed), param);
    }
    probes
}

unsafe extern "C" fn pin_changed(_: *mut ffi::avr_irq_t, value: u32, param: *mut c_void) {
    // SAFETY: `param` is a probe that `watch` made. The machine holds no reference to its bus
    // while instructions run or pins are driven, which is when simavr calls this.
    let (probe, bus) = unsafe {
        let probe = &*param.cast::<Probe>();
        (probe, &mut *probe.bus.as_ptr())
    };
    let now = bus.cpu.write_cycle();
    let high = value & 1 != 0;
    match probe.what {
        What::Step(motor) => {
            let stepped = bus.recorder.step_edge(motor, high, now, bus.sums);
            if let (Some(positive), Some(mechanics)) = (stepped, &mut bus.mechanics) {
                mechanics.step(motor, positive, now);
                bus.due = bus.due.min(mechanics.due());
            }
        }
        What::Dir(motor) => bus.recorder.dir_edge(motor, high, now),
        What::Select(pin) => bus.spi.select(pin, high, now),
        What::Input(pin) => {
            bus.changed.push((pin, high));
            bus.due = bus.due.min(now);
        }
        What::Clock(timer) if high => bus.timers[timer].rising_edge(),
        What::Clock(_) => {}
        What::Spindle(pin) => {
            if let Some(mechanics) = &mut bus.mechanics {
                mechanics.spindle(pin, high, now);
                bus.due = bus.due.min(mechanics.due());
            }
        }
    }
}
