//! Measurements of the running firmware: time in interrupts, time with interrupts off, stack depth.

use std::collections::BTreeMap;

use crate::chip::Chip;
use crate::cpu::Cpu;

/// The opcode of `out SPH, Rr` under this mask.
const OUT_SPH: u16 = 0xBE0E;
const OUT_MASK: u16 = 0xFE0F;

/// The opcode of `sbic TIFR1, OCF1A`, with which a handler checks whether a tick is due. If it is, the handler calls
/// the step interrupt.
const LOOKS_FOR_TICK: u16 = 0x99B1;

/// The longest time with interrupts off in some context.
#[derive(Clone, Copy, Default, PartialEq, Eq, Debug)]
pub struct Window {
    /// Its length.
    pub cycles: u64,
    /// Byte address at which interrupts went off.
    pub from_pc: u32,
    /// Byte address at which they went on again.
    pub to_pc: u32,
    /// Cycle at which it began.
    pub at: u64,
    /// The interrupt that was being served; `None` in thread code.
    pub vector: Option<u8>,
}

/// One vector's service. Times are in cycles, from acceptance to the end of RETI.
#[derive(Clone, Copy, Default, PartialEq, Eq, Debug)]
pub struct Service {
    /// How often the interrupt was served.
    pub count: u64,
    /// Longest time, without the interrupts nested in it.
    pub own_max: u64,
    /// Sum of these times.
    pub own_sum: u64,
    /// Longest time from the flag to acceptance.
    pub latency_max: u64,
}

#[derive(Clone, Copy)]
struct Frame {
    vector: u8,
    began: u64,
    nested: u64,
}

/// All meters. `clear` begins a new measurement.
pub struct Meters {
    step_vector: Option<u8>,
    ram_start: u16,
    services: Vec<Service>,
    frames: Vec<Frame>,
    window_outside: Window,
    window_step: Window,
    places: Option<BTreeMap<u32, Window>>,
    open: Option<Window>,
    was_on: bool,
    booted: bool,
    lowest_sp: u16,
}

impl Meters {
    /// Meters at rest; `step_vector` is the step interrupt, if there is one.
    pub fn new(chip: &Chip, step_vector: Option<u8>) -> Self {
        Meters {
            step_vector,
            ram_start: chip.ram_start,
            services: vec![Service::default(); chip.vectors.len()],
            frames: Vec::new(),
            window_outside: Window::default(),
            window_step: Window::default(),
            places: None,
            open: None,
            was_on: false,
            booted: false,
            lowest_sp: u16::MAX,
        }
    }

    /// Clears all measurements except the lowest point of the stack, which counts from power-up.
    pub fn clear(&mut self) {
        self.services.fill(Service::default());
        self.window_outside = Window::default();
        self.window_step = Window::default();
    }

    /// Takes note that the chip was reset.
    pub fn reset(&mut self) {
        self.frames.clear();
        self.open = None;
        self.was_on = false;
        self.booted = false;
    }

    /// Returns how a vector was served.
    pub fn service(&self, vector: u8) -> Service {
        self.services.get(usize::from(vector)).copied().unwrap_or_default()
    }

    /// Longest time in which no tick was served, anywhere outside the step interrupt: interrupts were off, and no
    /// handler checked for a tick.
    pub fn window_outside(&self) -> Window {
        self.window_outside
    }

    /// Longest time with interrupts off in the step interrupt.
    pub fn window_step(&self) -> Window {
        self.window_step
    }

    /// From now on keeps the longest window of each place where interrupts go off.
    pub fn start_places(&mut self) {
        self.places = Some(BTreeMap::new());
    }

    /// Returns the windows that were kept since [`Meters::start_places`], longest first.
    pub fn places(&self) -> Vec<Window> {
        let mut windows: Vec<Window> = self.places.iter().flatten().map(|(_, w)| *w).collect();
        windows.sort_by_key(|w| std::cmp::Reverse(w.cycles));
        windows
    }

    /// Lowest stack pointer seen; `None` before any use of the stack.
    pub fn lowest_sp(&self) -> Option<u16> {
        (self.lowest_sp != u16::MAX).then_some(self.lowest_sp)
    }

    /// Whether interrupts have been on since the reset.
    pub fn booted(&self) -> bool {
        self.booted
    }

    /// Number of nested interrupts that are being served.
    #[inline]
    pub fn depth(&self) -> usize {
        self.frames.len()
    }

    /// Returns the time of an interrupt so far, without the interrupts nested in it. `None` unless it is the running
    /// one: not interrupted, and not nested in itself.
    pub fn serving(&self, vector: u8, now: u64) -> Option<u64> {
        let (top, below) = self.frames.split_last()?;
        let outermost = top.vector == vector && below.iter().all(|f| f.vector != vector);
        outermost.then(|| (now - top.began).saturating_sub(top.nested))
    }

    /// Takes note that the instruction at `pc`, begun at `began`, was executed.
    #[inline]
    pub fn executed(&mut self, cpu: Cpu, pc: u32, began: u64) {
        let on = cpu.interrupts_on();
        if on != self.was_on {
            self.was_on = on;
            if on { self.went_on(cpu, pc) } else { self.went_off(pc, began) }
        } else if !on && cpu.opcode(pc) == LOOKS_FOR_TICK {
            // A handler that checks for a tick also calls the step interrupt if a tick is due, so the window ends
            // here.
            self.went_on(cpu, pc);
            self.went_off(pc, cpu.cycle());
        }
        let sp = cpu.sp();
        if sp < self.lowest_sp {
            self.sank(cpu, pc, sp);
        }
    }

    fn went_off(&mut self, pc: u32, at: u64) {
        let vector = self.frames.last().map(|f| f.vector);
        self.open = Some(Window { cycles: 0, from_pc: pc, to_pc: pc, at, vector });
    }

    fn went_on(&mut self, cpu: Cpu, pc: u32) {
        self.booted = true;
        let Some(mut window) = self.open.take() else { return };
        window.cycles = cpu.cycle() - window.at;
        window.to_pc = pc;
        if let Some(places) = &mut self.places {
            let place = places.entry(window.from_pc).or_default();
            if window.cycles > place.cycles {
                *place = window;
            }
        }
        let inside = window.vector.is_some() && window.vector == self.step_vector;
        let worst = if inside { &mut self.window_step } else { &mut self.window_outside };
        if window.cycles > worst.cycles {
            *worst = window;
        }
    }

    fn sank(&mut self, cpu: Cpu, pc: u32, sp: u16) {
        // A stack pointer is written in two halves, high half first, with one instruction in between. Between the
        // halves its value is meaningless.
        let is_half = |pc: u32| cpu.opcode(pc) & OUT_MASK == OUT_SPH;
        let half_written = is_half(pc) || is_half(pc.saturating_sub(2));
        if !half_written && sp >= self.ram_start {
            self.lowest_sp = sp;
        }
    }

    /// Takes note that an interrupt was accepted at cycle `at`. Its flag went up at `raised`, if that is known.
    pub fn entered(&mut self, vector: u8, at: u64, pc: u32, raised: Option<u64>) {
        self.frames.push(Frame { vector, began: at, nested: 0 });
        self.was_on = false;
        self.went_off(pc, at);
        if let Some(raised) = raised {
            let service = &mut self.services[usize::from(vector)];
            service.latency_max = service.latency_max.max(at.saturating_sub(raised));
        }
    }

    /// Whether this is the interrupt being served.
    #[inline]
    pub fn is_in(&self, vector: u8) -> bool {
        self.frames.last().is_some_and(|frame| frame.vector == vector)
    }

    /// Takes note that another handler called the handler of an interrupt, instead of the interrupt being accepted.
    pub fn called(&mut self, vector: u8, cpu: Cpu) {
        self.went_on(cpu, cpu.pc());
        self.entered(vector, cpu.cycle(), cpu.pc(), None);
    }

    /// RETI ended at cycle `now`. Returns the time in interrupts, if this was the outermost.
    pub fn left(&mut self, now: u64) -> Option<u64> {
        let frame = self.frames.pop()?;
        let total = now - frame.began;
        let own = total - frame.nested.min(total);
        let service = &mut self.services[usize::from(frame.vector)];
        service.count += 1;
        service.own_sum += own;
        service.own_max = service.own_max.max(own);
        match self.frames.last_mut() {
            Some(outer) => {
                outer.nested += total;
                None
            }
            None => Some(total),
        }
    }
}
