//! The peripherals that replace simavr's, and the dispatch of register accesses to them.

use std::ffi::{c_int, c_void};
use std::ptr::NonNull;

use kerf::boards::Pin;
use simavr_ffi as ffi;

use crate::chip::{Chip, MAX_VECTORS};
use crate::cpu::Cpu;
use crate::eeprom::Eeprom;
use crate::flash::{Flash, SPMCSR};
use crate::mechanics::Mechanics;
use crate::pins::PinInterrupts;
use crate::recorder::{Recorder, Sums};
use crate::spi::Spi;
use crate::timer::Timer;
use crate::uart::{OFFSETS, Uart};
use crate::wire::Wire;

/// Which peripheral owns a register.
#[derive(Clone, Copy)]
enum Owner {
    Nobody,
    Timer(usize),
    Uart(usize),
    Eeprom,
    Pins,
    Spi,
    Flash,
}

/// First address after the I/O registers.
const IO_END: usize = 0x138;

/// Everything around the CPU.
pub struct Bus {
    pub(crate) cpu: Cpu,
    chip: &'static Chip,
    owners: [Owner; IO_END],
    pub(crate) timers: Vec<Timer>,
    /// Index of the timer that makes the ticks of the step generator, if there is one.
    step_timer: Option<usize>,
    pub(crate) uarts: Vec<Uart>,
    pub(crate) eeprom: Eeprom,
    /// Self-programming, on a machine with a boot loader.
    flash: Option<Box<FlashPort>>,
    /// The serial lines of the board's ports, each with the index of the USART that it leads to.
    pub(crate) wires: Vec<(usize, Wire)>,
    pins: PinInterrupts,
    pub(crate) spi: Spi,
    pub(crate) recorder: Recorder,
    pub(crate) mechanics: Option<Box<Mechanics>>,
    /// Cycle at which the temperatures are computed next, and the cycles between two computations. `NEVER` without
    /// heaters.
    pub(crate) heat_due: u64,
    /// See `heat_due`.
    pub(crate) heat_every: u64,
    /// How many computations of the temperatures have become due; the machine makes them.
    pub(crate) heats: u32,
    /// Pins whose level the mechanics has changed; the machine drives them.
    pub(crate) changed: Vec<(Pin, bool)>,
    pub(crate) sums: Sums,
    /// Interrupts that ask for service, by vector.
    pub(crate) pending: u64,
    /// Interrupts that are not served although they ask, by vector.
    withheld: u64,
    /// Cycle at which each interrupt began to ask for service, by vector.
    raised_at: [u64; MAX_VECTORS],
    /// Cycle of the next event.
    pub(crate) due: u64,
}

impl Bus {
    /// Puts the peripherals around a CPU. The CPU keeps the pointer that is returned.
    pub fn install(
        cpu: Cpu,
        chip: &'static Chip,
        step_timer: Option<usize>,
        wires: Vec<(usize, Wire)>,
    ) -> NonNull<Bus> {
        let bus = Box::new(Bus {
            cpu,
            chip,
            owners: owners(chip),
            timers: chip.timers.iter().map(Timer::new).collect(),
            step_timer,
            uarts: chip.usarts.iter().copied().map(Uart::new).collect(),
            eeprom: Eeprom::new(),
            flash: None,
            wires,
            pins: PinInterrupts::new(&chip.pins),
            spi: Spi::new(),
            recorder: Recorder::new(),
            mechanics: None,
            heat_due: u64::MAX,
            heat_every: 0,
            heats: 0,
            changed: Vec::new(),
            sums: Sums::default(),
            pending: 0,
            withheld: 0,
            raised_at: [0; MAX_VECTORS],
            due: u64::MAX,
        });
        let bus = NonNull::from(Box::leak(bus));
        let param = bus.as_ptr().cast::<c_void>();
        for (addr, owner) in owners(chip).iter().enumerate() {
            if !matches!(owner, Owner::Nobody) {
                cpu.hook(addr as u16, Some(io_read), Some(io_write), param);
            }
        }
        for (timer, layout) in chip.timers.iter().enumerate() {
            cpu.hook_bits(layout.tifr, TIFR_BITS[timer], param);
        }
        for (register, write) in PinInterrupts::FLAGS.into_iter().zip(PIN_FLAG_BITS) {
            cpu.hook_bits(register, write, param);
        }
        bus
    }

    /// Lets programs change the flash, as silicon does it. Called once, before the first instruction.
    pub fn allow_programming(&mut self) {
        let bus: *mut Bus = self;
        // SAFETY: numbers and null pointers, for which 0 is a value.
        let mut io: ffi::avr_io_t = unsafe { std::mem::zeroed() };
        io.ioctl = Some(flash_access);
        let port = self.flash.insert(Box::new(FlashPort { io, bus, state: Flash::new() }));
        self.cpu.take_over_flash(&raw mut port.io);
        self.owners[usize::from(SPMCSR)] = Owner::Flash;
        self.cpu.hook(SPMCSR, Some(io_read), Some(io_write), bus.cast());
    }

    /// Self-programming, on a machine with a boot loader.
    pub fn flash(&mut self) -> Option<&mut Flash> {
        self.flash.as_mut().map(|flash| &mut flash.state)
    }

    /// Puts all peripherals into their state after a reset; the world outside keeps its state.
    pub fn reset(&mut self) {
        self.timers.iter_mut().for_each(Timer::reset);
        self.uarts = self.chip.usarts.iter().copied().map(Uart::new).collect();
        self.eeprom.reset();
        if let Some(flash) = &mut self.flash {
            flash.state.reset();
        }
        self.spi.reset();
        self.pins = PinInterrupts::new(&self.chip.pins);
        self.recorder.pins_released();
        self.pending = 0;
        self.refresh_due();
    }

    /// Handles all events that are due by `now`.
    pub fn run(&mut self, now: u64) {
        while self.due <= now {
            for (usart, wire) in &mut self.wires {
                if wire.due() <= now {
                    wire.pump(&mut self.uarts[*usart]);
                }
            }
            for i in 0..self.timers.len() {
                if self.timers[i].due() <= now {
                    self.timers[i].advance(now);
                    self.update_timer(i, self.timers[i].last_event());
                }
            }
            for i in 0..self.uarts.len() {
                if self.uarts[i].due() <= now {
                    let at = self.uarts[i].due();
                    self.uarts[i].advance(now);
                    self.update_uart(i, at);
                }
            }
            if self.eeprom.due() <= now {
                self.eeprom.advance(now);
                self.update_eeprom(now);
            }
            if let Some(flash) = &mut self.flash {
                flash.state.advance(now);
            }
            for (usart, wire) in &mut self.wires {
                wire.listen(&mut self.uarts[*usart]);
            }
            if let Some(mechanics) = &mut self.mechanics {
                mechanics.advance(now, &mut self.changed);
            }
            if self.heat_due <= now {
                self.heat_due += self.heat_every;
                self.heats += 1;
            }
            self.refresh_due();
        }
    }

    /// Tells the peripheral that its interrupt is being served.
    pub fn acknowledge(&mut self, vector: u8, now: u64) {
        let bit = 1u64 << vector;
        if let Some(i) = self.chip.timers.iter().position(|t| t.vectors.contains(&vector)) {
            self.timers[i].acknowledge(vector, now);
            self.update_timer(i, now);
        } else if let Some(i) =
            self.chip.usarts.iter().position(|(_, first)| (7u64 << first) & bit != 0)
        {
            self.uarts[i].acknowledge(vector);
            self.update_uart(i, now);
        } else if self.chip.pins.vectors() & bit != 0 {
            self.pins.acknowledge(vector);
            self.update_pins(now);
        }
        self.refresh_due();
    }

    /// Withholds an interrupt of a USART from service, or releases it.
    pub fn withhold(&mut self, vector: u8, withheld: bool) {
        let bit = 1 << vector;
        self.withheld = if withheld { self.withheld | bit } else { self.withheld & !bit };
        (0..self.uarts.len()).for_each(|i| self.update_uart(i, self.cpu.cycle()));
    }

    /// A fault: from now on a timer counts at a share of its right rate.
    pub fn set_pace(&mut self, timer: usize, pace: f64) {
        let now = self.cpu.cycle();
        self.timers[timer].set_pace(pace, now);
        self.update_timer(timer, now);
        self.refresh_due();
    }

    /// Takes a change of an input's level.
    pub fn pin_edge(&mut self, port: char, bit: u8, high: bool) {
        self.pins.edge(port, bit, high);
        self.update_pins(self.cpu.cycle());
    }

    /// Returns the cycle at which a pending interrupt began to ask for service.
    pub fn raised_at(&self, vector: u8) -> u64 {
        self.raised_at[usize::from(vector)]
    }

    /// Begins sending bytes to a port.
    pub fn send(&mut self, port: usize, bytes: &[u8]) {
        self.wires[port].1.send(bytes, self.cpu.cycle());
        self.refresh_due();
    }

    /// Sends a byte to a port ahead of what still waits.
    pub fn send_first(&mut self, port: usize, byte: u8) {
        self.wires[port].1.send_first(byte, self.cpu.cycle());
        self.refresh_due();
    }

    /// Computes when the next event is due.
    pub(crate) fn refresh_due(&mut self) {
        let timers = self.timers.iter().map(Timer::due);
        let uarts = self.uarts.iter().map(Uart::due);
        let wires = self.wires.iter().map(|(_, wire)| wire.due());
        let mechanics = self.mechanics.as_ref().map_or(u64::MAX, |m| m.due());
        let flash = self.flash.as_ref().map_or(u64::MAX, |flash| flash.state.due());
        let others = [self.eeprom.due(), flash, mechanics, self.heat_due];
        let due = timers.chain(uarts).chain(wires).chain(others).min().unwrap_or(u64::MAX);
        // A program that polls a USART may see the end of a frame ahead of its event. The wire hears of it at once.
        let unheard = self.wires.iter().any(|(usart, _)| self.uarts[*usart].has_sent());
        self.due = if unheard { 0 } else { due };
    }

    fn update_timer(&mut self, i: usize, at: u64) {
        let mask =
            self.chip.timers[i].vectors.iter().filter(|v| **v != 0).fold(0, |m, v| m | 1u64 << v);
        self.set_lines(mask, self.timers[i].lines(), at);
    }

    fn update_uart(&mut self, i: usize, at: u64) {
        self.set_lines(7u64 << self.chip.usarts[i].1, self.uarts[i].lines(), at);
    }

    fn update_eeprom(&mut self, at: u64) {
        let ready = self.chip.eeprom_ready;
        self.set_lines(1u64 << ready, u64::from(self.eeprom.asks()) << ready, at);
    }

    fn update_pins(&mut self, at: u64) {
        self.set_lines(self.chip.pins.vectors(), self.pins.lines(), at);
    }

    fn set_lines(&mut self, mask: u64, lines: u64, at: u64) {
        let lines = lines & !self.withheld;
        let mut fresh = lines & !self.pending;
        self.pending = (self.pending & !mask) | lines;
        while fresh != 0 {
            self.raised_at[fresh.trailing_zeros() as usize] = at;
            fresh &= fresh - 1;
        }
    }

    pub(crate) fn store(&mut self, addr: u16, value: u8) {
        let now = self.cpu.write_cycle();
        self.cpu.set_data(usize::from(addr), value);
        match self.owners[usize::from(addr)] {
            Owner::Timer(i) => {
                let ran = self.timers[i].runs();
                self.timers[i].write(addr, value, now);
                let runs = self.timers[i].runs();
                if Some(i) == self.step_timer && ran != runs {
                    self.recorder.timer(runs, now);
                }
                self.update_timer(i, now);
            }
            Owner::Uart(i) => {
                self.uarts[i].write(addr, value, now);
                self.update_uart(i, now);
            }
            Owner::Eeprom => {
                let hold = self.eeprom.write(addr, value, now);
                self.cpu.set_cycle(self.cpu.cycle() + hold);
                self.update_eeprom(now);
            }
            Owner::Pins => {
                // simavr's own pin interrupts read this memory. A 0 there tells them that all pin interrupts are off.
                self.cpu.set_data(usize::from(addr), 0);
                self.pins.write(addr, value);
                self.update_pins(now);
            }
            Owner::Spi => self.spi.write(addr, value, now, self.cpu),
            Owner::Flash => {
                if let Some(flash) = &mut self.flash {
                    flash.state.write(value, now);
                }
            }
            Owner::Nobody => {}
        }
        self.refresh_due();
    }

    fn load(&mut self, addr: u16) -> u8 {
        let now = self.cpu.read_cycle();
        let kept = self.cpu.data(usize::from(addr));
        let value = match self.owners[usize::from(addr)] {
            Owner::Timer(i) => {
                let value = self.timers[i].read(addr, now);
                self.update_timer(i, now);
                value
            }
            Owner::Uart(i) => {
                let value = self.uarts[i].read(addr, now);
                self.update_uart(i, now);
                value
            }
            Owner::Eeprom => self.eeprom.read(addr, now),
            Owner::Pins => Some(self.pins.read(addr)),
            Owner::Spi => Some(self.spi.read(addr, now)),
            Owner::Flash => self.flash.as_ref().map(|flash| flash.state.read(now)),
            Owner::Nobody => None,
        };
        self.refresh_due();
        value.unwrap_or(kept)
    }

    fn clear_flag(&mut self, timer: usize, bit: u8) {
        let now = self.cpu.write_cycle();
        self.timers[timer].clear(1 << bit, now);
        self.update_timer(timer, now);
        self.refresh_due();
    }

    fn clear_pin_flag(&mut self, register: u16, bit: u8) {
        self.pins.write(register, 1 << bit);
        self.update_pins(self.cpu.write_cycle());
    }
}

/// Self-programming as simavr sees it: a part that it asks at each SPM and LPM.
#[repr(C)]
struct FlashPort {
    /// simavr has a pointer to this field.
    io: ffi::avr_io_t,
    bus: *mut Bus,
    state: Flash,
}

/// simavr's requests at an SPM and at an LPM.
const SPM: u32 = u32::from_be_bytes(*b"fspm");
/// See [`SPM`].
const LPM: u32 = u32::from_be_bytes(*b"flpm");

/// SPM is executed, or LPM reads a byte, which is at `value`.
unsafe extern "C" fn flash_access(io: *mut ffi::avr_io_t, what: u32, value: *mut c_void) -> c_int {
    // SAFETY: `io` is the first field of a `FlashPort`, which belongs to the bus; see `bus_of`.
    let bus = unsafe { bus_of((*io.cast::<FlashPort>()).bus.cast()) };
    let cpu = bus.cpu;
    let Some(flash) = bus.flash() else { return -1 };
    match what {
        SPM => {
            flash.program(cpu, cpu.z());
            bus.refresh_due();
        }
        LPM => {
            if let Some(byte) = flash.read_program(cpu.cycle(), cpu.z()) {
                // SAFETY: simavr passes a byte that lives during the call.
                unsafe { value.cast::<u8>().write(byte) };
            }
        }
        _ => return -1,
    }
    0
}

fn owners(chip: &Chip) -> [Owner; IO_END] {
    let mut owners = [Owner::Nobody; IO_END];
    for (i, layout) in chip.timers.iter().enumerate() {
        for addr in layout.registers() {
            owners[usize::from(addr)] = Owner::Timer(i);
        }
    }
    for (i, (base, _)) in chip.usarts.iter().enumerate() {
        for offset in OFFSETS {
            owners[usize::from(base + offset)] = Owner::Uart(i);
        }
    }
    for addr in chip.pins.registers() {
        owners[usize::from(addr)] = Owner::Pins;
    }
    for addr in Spi::REGISTERS {
        owners[usize::from(addr)] = Owner::Spi;
    }
    for addr in Eeprom::REGISTERS {
        owners[usize::from(addr)] = Owner::Eeprom;
    }
    owners
}

/// The bus behind a callback's parameter.
///
/// # Safety
/// `param` is what `Bus::install` gave to simavr, and simavr is executing an instruction: the
/// machine holds no reference to its bus then.
unsafe fn bus_of<'a>(param: *mut c_void) -> &'a mut Bus {
    // SAFETY: as the function demands.
    unsafe { &mut *param.cast::<Bus>() }
}

unsafe extern "C" fn io_write(_: *mut ffi::avr_t, addr: u16, value: u8, param: *mut c_void) {
    // SAFETY: simavr calls this only while it executes an instruction.
    unsafe { bus_of(param) }.store(addr, value);
}

unsafe extern "C" fn io_read(_: *mut ffi::avr_t, addr: u16, param: *mut c_void) -> u8 {
    // SAFETY: simavr calls this only while it executes an instruction.
    unsafe { bus_of(param) }.load(addr)
}

/// SBI and CBI on a TIFR touch one flag only.
unsafe extern "C" fn tifr_bit<const TIMER: usize>(
    _: *mut ffi::avr_t,
    bit: u8,
    value: u8,
    param: *mut c_void,
) -> c_int {
    if value != 0 {
        // SAFETY: simavr calls this only while it executes an instruction.
        unsafe { bus_of(param) }.clear_flag(TIMER, bit);
    }
    1
}

/// A bit of a register of pin-interrupt flags is written: a 1 clears the flag.
unsafe extern "C" fn pin_flag_bit<const REGISTER: usize>(
    _: *mut ffi::avr_t,
    bit: u8,
    value: u8,
    param: *mut c_void,
) -> c_int {
    if value != 0 {
        // SAFETY: simavr calls this only while it executes an instruction.
        unsafe { bus_of(param) }.clear_pin_flag(PinInterrupts::FLAGS[REGISTER], bit);
    }
    1
}

const PIN_FLAG_BITS: [crate::cpu::BitWrite; 2] = [pin_flag_bit::<0>, pin_flag_bit::<1>];

const TIFR_BITS: [crate::cpu::BitWrite; 6] =
    [tifr_bit::<0>, tifr_bit::<1>, tifr_bit::<2>, tifr_bit::<3>, tifr_bit::<4>, tifr_bit::<5>];
