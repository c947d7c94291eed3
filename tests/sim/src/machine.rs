//! The machine: CPU, peripherals and meters, and the loop that drives them.

use std::fmt;
use std::path::Path;
use std::ptr::NonNull;

use anyhow::{Result, ensure};
use kerf::boards::{Board, Pin, Usart};

use crate::bus::Bus;
use crate::card::SdCard;
use crate::chip::{ATMEGA2560, Chip};
use crate::counts::Counts;
use crate::cpu::{Cpu, Mode};
use crate::eeprom;
use crate::emulated::is_emulated;
use crate::flash::{BOOT, Flash};
use crate::image::Image;
use crate::loader::Loader;
use crate::mechanics::{Build, Mechanics};
use crate::meters::{Meters, Window};
use crate::recorder::{self, Probe, Recorder};
use crate::spi::Max6675;
use crate::stopwatch::Stopwatch;
use crate::stuck::Stuck;
use crate::thermal::{EVERY_MS, Thermal};
use crate::timer::COMPARE;
use crate::trace::Trace;
use crate::uart::Uart;
use crate::wire::Wire;

/// Extra cycles until an interrupt is entered when it ends a sleep.
const WAKE_CYCLES: u64 = 4;

/// The ports of a board, as [`Machine::send_to`] counts them.
pub const USB: usize = 0;
/// See [`USB`].
pub const AUX: usize = 1;

/// A fault that ends the simulation.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Fault {
    /// An instruction that does not exist, or a jump out of the program.
    BadInstruction {
        /// Where.
        place: String,
    },
    /// A sleep with interrupts off: nothing can wake the CPU.
    SleepsForever {
        /// Where.
        place: String,
    },
    /// The stack has reached static data.
    StackOverflow {
        /// Where.
        place: String,
        /// Bytes of static data overwritten.
        bytes: u16,
    },
    /// Interrupts nest without end.
    EndlessNesting,
    /// Bytes were written to a transmitter that had no room for them.
    LostByte,
    /// An interrupt came while the flash with its handler was being erased or written.
    UnreadableFlash {
        /// Its name.
        vector: &'static str,
    },
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Fault::BadInstruction { place } => write!(f, "bad instruction in {place}"),
            Fault::SleepsForever { place } => write!(f, "sleeps with interrupts off in {place}"),
            Fault::StackOverflow { place, bytes } => {
                write!(f, "the stack runs {bytes} bytes into static data in {place}")
            }
            Fault::EndlessNesting => f.write_str("interrupts nest without end"),
            Fault::UnreadableFlash { vector } => {
                write!(f, "the interrupt {vector} while the flash cannot be read")
            }
            Fault::LostByte => f.write_str("a byte was written to a transmitter that had no room"),
        }
    }
}

impl std::error::Error for Fault {}

/// A simulated chip, on a board or alone, running a firmware image.
pub struct Machine {
    cpu: Cpu,
    bus: NonNull<Bus>,
    /// The state that the pins' callbacks point to.
    probes: Vec<Vec<Probe>>,
    /// For each port, by its letter: the pins that are driven from outside, and their levels.
    driven: [(u8, u8); 12],
    meters: Meters,
    /// The vector of the step interrupt and the address of its handler. Other handlers call it when a tick is due.
    step_handler: Option<(u8, u32)>,
    image: Image,
    chip: &'static Chip,
    clock_hz: u32,
    board: Option<&'static Board>,
    resets: u64,
    /// Cycles spent at each word of flash, if a profile was started.
    profile: Option<Vec<u64>>,
    /// How often each word of flash ran, if the environment asks for it.
    counts: Option<Counts>,
    stopwatches: Vec<Stopwatch>,
    /// Bytes of RAM with bits that do not change.
    stuck: Vec<Stuck>,
    /// Whether there is a profile, counts, a stopwatch or a stuck byte. One flag, so that the loop has only one check
    /// for each instruction.
    is_watched: bool,
    thermal: Option<Box<Thermal>>,
}

impl Machine {
    /// A board, with this image in its chip's flash, at cycle 0. Its serial line runs at 115200 baud.
    pub fn new(image: Image, board: &'static Board) -> Result<Self> {
        ensure!(!is_emulated(board), "the board {} is emulated, not simulated", board.name);
        let wires = board.serial.iter().map(|serial| {
            let usart = match serial.usart {
                Usart::U0 => 0,
                Usart::U1 => 1,
                Usart::U3 => 3,
                // These belong to the RP2040, which is emulated: the check above refuses it.
                Usart::Uart0 | Usart::Uart1 | Usart::Usb => 0,
            };
            (usart, Wire::new(board.clock_hz, serial.rate))
        });
        Self::make(image, &ATMEGA2560, board.clock_hz, Some(board), wires.collect())
    }

    /// A chip alone at cycle 0, with this image in its flash, and a serial line of 115200 baud at its first USART.
    pub fn bare(image: Image, chip: &'static Chip, clock_hz: u32) -> Result<Self> {
        Self::make(image, chip, clock_hz, None, vec![(0, Wire::new(clock_hz, 115_200))])
    }

    fn make(
        image: Image,
        chip: &'static Chip,
        clock_hz: u32,
        board: Option<&'static Board>,
        wires: Vec<(usize, Wire)>,
    ) -> Result<Self> {
        let cpu = Cpu::power_up(&image, chip, clock_hz)?;
        let step_timer = board.map(|board| board.step_timer as usize);
        let bus = Bus::install(cpu, chip, step_timer, wires);
        let probes = board.map(|board| recorder::attach(bus, cpu, board));
        let step_vector = step_timer.map(|n| chip.timers[n].vectors[COMPARE]);
        let meters = Meters::new(chip, step_vector);
        let counts = Counts::wanted();
        let mut machine = Machine {
            cpu,
            bus,
            probes: probes.into_iter().collect(),
            driven: [(0, 0); 12],
            meters,
            step_handler: None,
            image,
            chip,
            clock_hz,
            board,
            resets: 0,
            profile: None,
            is_watched: counts.is_some(),
            counts,
            stopwatches: Vec::new(),
            stuck: Vec::new(),
            thermal: None,
        };
        machine.find_step_handler();
        Ok(machine)
    }

    /// Finds the handler of the step interrupt by the jump at its vector. Without a jump, or with one to where other
    /// vectors jump too, no handler is known.
    fn find_step_handler(&mut self) {
        let vectors = 0..self.chip.vectors.len() as u8;
        let target = |vector: u8| {
            jump(self.cpu.opcode(u32::from(vector) * 4), self.cpu.opcode(u32::from(vector) * 4 + 2))
        };
        let handler = self.board.and_then(|board| {
            let vector = self.chip.timers[board.step_timer as usize].vectors[COMPARE];
            let handler = target(vector)?;
            let is_alone = vectors.filter(|other| target(*other) == Some(handler)).count() == 1;
            is_alone.then_some((vector, handler))
        });
        self.step_handler = handler;
    }

    /// Puts a boot loader into the boot section, and lets it change the flash. The chip starts in it, now and after
    /// each reset. It is called once, before the first instruction.
    pub fn install(&mut self, loader: &Loader) {
        for (at, bytes) in loader.parts() {
            self.cpu.set_flash(*at, bytes);
        }
        self.bus_mut().allow_programming();
        self.cpu.set_start(BOOT);
        self.reset();
    }

    /// Replaces the content of the flash from address 0 on, as another program there would have left it.
    pub fn fill_flash(&mut self, bytes: &[u8]) {
        self.cpu.set_flash(0, bytes);
        self.image = Image::default();
        self.find_step_handler();
    }

    /// Resets the chip as the button does, or a sender by DTR. Memory and the world outside keep their state.
    pub fn reset(&mut self) {
        self.cpu.reset();
        self.was_reset();
    }

    /// Whether flash holds an image. If so, its symbols are used from now on.
    pub fn recognises(&mut self, image: &Image) -> bool {
        let is_same = (0..).zip(&image.flash).all(|(at, byte)| self.flash(at) == *byte);
        if is_same {
            self.image = image.clone();
        }
        is_same
    }

    /// Takes note that a program has changed the flash: the symbols of the image are those of another program.
    fn follow_flash(&mut self) {
        if self.bus_mut().flash().is_some_and(Flash::take_changed) {
            self.image = Image::default();
            self.find_step_handler();
        }
    }

    /// A machine with the ELF file at `path` in its flash.
    pub fn load(path: &Path, board: &'static Board) -> Result<Self> {
        Self::new(Image::read(path)?, board)
    }

    pub(crate) fn bus(&self) -> &Bus {
        // SAFETY: the bus lives as long as the machine; `&self` keeps the CPU from running.
        unsafe { self.bus.as_ref() }
    }

    pub(crate) fn bus_mut(&mut self) -> &mut Bus {
        // SAFETY: the bus lives as long as the machine; `&mut self` keeps the CPU from running.
        unsafe { self.bus.as_mut() }
    }

    /// Executes one instruction and serves at most one interrupt. If the CPU sleeps, goes on to the next event or to
    /// cycle `limit`, whichever is first.
    pub fn step(&mut self, limit: u64) -> Result<(), Fault> {
        self.go_on(limit).map(|_| ())
    }

    /// The body of [`Machine::step`], inlined into the loops that run it. Returns whether an event came.
    #[inline(always)]
    fn go_on(&mut self, limit: u64) -> Result<bool, Fault> {
        let cpu = self.cpu;
        let (mut woken, mut event) = (false, false);
        if cpu.mode() == Mode::Running {
            let (pc, began) = (cpu.pc(), cpu.cycle());
            if let Some((vector, handler)) = self.step_handler
                && pc == handler
                && !self.meters.is_in(vector)
            {
                self.called(vector)?;
            }
            cpu.execute();
            self.meters.executed(cpu, pc, began);
            if self.is_watched {
                self.watch(pc, began);
            }
            if usize::from(cpu.depth()) < self.meters.depth() {
                self.leave();
            }
        } else {
            self.idle(limit)?;
            woken = true;
        }
        if cpu.cycle() >= self.bus().due {
            event = true;
            self.bus_mut().run(cpu.cycle());
            self.drive_changed();
            self.pass_heat();
            self.follow_flash();
        }
        if cpu.cycle() >= cpu.native_due() && cpu.run_native() {
            self.resets += 1;
            self.was_reset();
        }
        if cpu.take_shadow() {
            return Ok(event);
        }
        if (self.bus().pending != 0 || cpu.native_pending()) && cpu.interrupts_on() {
            self.serve(woken)?;
        }
        Ok(event)
    }

    /// Tells the profile, the counts and the stopwatches that the instruction at `pc`, begun at `began`, was
    /// executed. Puts stuck bits back that it has changed.
    #[cold]
    fn watch(&mut self, pc: u32, began: u64) {
        if let Some(spent) = self.profile.as_mut().and_then(|p| p.get_mut(pc as usize / 2)) {
            *spent += self.cpu.cycle() - began;
        }
        if let Some(counts) = &mut self.counts {
            counts.executed(pc);
        }
        if !self.stopwatches.is_empty() {
            self.time(pc, began);
        }
        for stuck in &self.stuck {
            let at = usize::from(stuck.address);
            self.cpu.set_data(at, stuck.of(self.cpu.data(at)));
        }
    }

    /// Adds a stopwatch, which measures from now on; see [`Machine::stopwatches`].
    pub fn add_stopwatch(&mut self, stopwatch: Stopwatch) {
        self.stopwatches.push(stopwatch);
        self.is_watched = true;
    }

    /// Returns the stopwatches, in the order in which they were added.
    pub fn stopwatches(&self) -> &[Stopwatch] {
        &self.stopwatches
    }

    /// Tells the stopwatches that the instruction at `pc`, begun at `began`, was executed.
    fn time(&mut self, pc: u32, began: u64) {
        let left = usize::from(self.cpu.depth()) < self.meters.depth();
        let in_interrupts = self.bus().sums.in_interrupts;
        for stopwatch in &mut self.stopwatches {
            stopwatch.executed(self.cpu, pc, began, &self.meters, in_interrupts, left);
        }
    }

    /// Starts a profile: from now on counts the cycles spent at each word of flash.
    pub fn start_profile(&mut self) {
        self.profile = Some(vec![0; 1 << 17]);
        self.is_watched = true;
    }

    /// Cycles spent in each function since [`Machine::start_profile`], most first.
    pub fn profile(&self) -> Vec<(String, u64)> {
        let mut functions = std::collections::HashMap::new();
        for (word, &cycles) in self.profile.iter().flatten().enumerate().filter(|(_, c)| **c > 0) {
            *functions.entry(self.image.function_at(word as u32 * 2)).or_insert(0) += cycles;
        }
        let mut sorted: Vec<_> = functions.into_iter().collect();
        sorted.sort_by_key(|(_, cycles)| std::cmp::Reverse(*cycles));
        sorted
    }

    /// Cycles spent at each instruction since [`Machine::start_profile`], by byte address.
    pub fn profile_by_address(&self) -> impl Iterator<Item = (u32, u64)> {
        let spent = self.profile.iter().flatten().enumerate();
        spent.filter(|(_, c)| **c > 0).map(|(word, &cycles)| (word as u32 * 2, cycles))
    }

    /// Runs to a cycle. The last instruction may end a few cycles after it.
    pub fn run_until(&mut self, cycle: u64) -> Result<(), Fault> {
        while self.cpu.cycle() < cycle {
            self.go_on(cycle)?;
        }
        self.check()
    }

    /// Runs to a cycle, or until a whole line has come over the serial line.
    pub fn run_until_line(&mut self, cycle: u64) -> Result<(), Fault> {
        let has_line = |machine: &Self| machine.bus().wires[USB].1.has_line();
        // A line becomes whole only at an event, so it is enough to look after events.
        let mut found = has_line(self);
        while !found && self.cpu.cycle() < cycle {
            found = self.go_on(cycle)? && has_line(self);
        }
        self.check()
    }

    /// Runs for a time.
    pub fn run_for_ms(&mut self, ms: u64) -> Result<(), Fault> {
        self.run_until(self.cycle() + self.cycles(ms))
    }

    fn idle(&mut self, limit: u64) -> Result<(), Fault> {
        let cpu = self.cpu;
        if cpu.mode() == Mode::Crashed {
            return Err(Fault::BadInstruction { place: self.place(cpu.pc()) });
        }
        if !cpu.interrupts_on() {
            return Err(Fault::SleepsForever { place: self.place(cpu.pc()) });
        }
        let now = cpu.cycle();
        let next = self.bus().due.min(cpu.native_due()).min(limit).max(now);
        cpu.set_cycle(next);
        self.bus_mut().sums.asleep += next - now;
        Ok(())
    }

    fn leave(&mut self) {
        if let Some(total) = self.meters.left(self.cpu.cycle()) {
            self.bus_mut().sums.in_interrupts += total;
        }
    }

    fn serve(&mut self, woken: bool) -> Result<(), Fault> {
        let cpu = self.cpu;
        let pending = self.bus().pending;
        let own = (pending != 0).then(|| pending.trailing_zeros() as u8);
        let native = if cpu.native_pending() { cpu.native_vector() } else { None };
        let Some(vector) = own.into_iter().chain(native).min() else { return Ok(()) };
        if self.bus_mut().flash().is_some_and(|flash| flash.is_unreadable()) {
            return Err(Fault::UnreadableFlash { vector: self.chip.vector_name(vector) });
        }
        let at = cpu.cycle();
        let raised = (own == Some(vector)).then(|| self.bus().raised_at(vector));
        let asleep = woken || cpu.mode() == Mode::Sleeping;
        cpu.wake();
        if !cpu.enter(vector) {
            return Err(Fault::EndlessNesting);
        }
        cpu.set_cycle(at + self.chip.entry_cycles + if asleep { WAKE_CYCLES } else { 0 });
        if own == Some(vector) {
            self.bus_mut().acknowledge(vector, at);
        } else {
            cpu.native_acknowledge(vector);
        }
        self.meters.entered(vector, at, cpu.pc(), raised);
        Ok(())
    }

    /// Takes note that a handler has called another handler.
    fn called(&mut self, vector: u8) -> Result<(), Fault> {
        if !self.cpu.adopt(vector) {
            return Err(Fault::EndlessNesting);
        }
        self.meters.called(vector, self.cpu);
        Ok(())
    }

    fn was_reset(&mut self) {
        self.bus_mut().reset();
        self.meters.reset();
        self.drive_again();
    }

    fn drive_changed(&mut self) {
        while let Some((pin, high)) = self.bus_mut().changed.pop() {
            self.drive_pin(pin.port.letter(), pin.bit, high);
        }
    }

    /// Computes the temperatures as often as they have become due.
    fn pass_heat(&mut self) {
        let heats = std::mem::take(&mut self.bus_mut().heats);
        let Some(mut thermal) = self.thermal.take_if(|_| heats > 0) else { return };
        let power = thermal.pins().heaters.map(|heater| self.power_at(heater.pin));
        let fan = self.power_at(thermal.pins().fan);
        for _ in 0..heats {
            for (channel, millivolts) in thermal.pass(power, fan, self.cpu.cycle()) {
                self.cpu.set_millivolts(channel, millivolts);
            }
        }
        self.thermal = Some(thermal);
    }

    /// Drives the pins again, because a reset makes the core forget how the outside world drives its pins.
    fn drive_again(&mut self) {
        for (port, (driven, levels)) in ('A'..='L').zip(self.driven) {
            for bit in (0..8).filter(|bit| driven & 1 << bit != 0) {
                self.cpu.drive_pin(port, bit, driven, levels);
            }
        }
    }

    fn check(&self) -> Result<(), Fault> {
        match self.free_stack() {
            Some(free) if free < 0 && self.meters.booted() => {
                let place = self.place(self.cpu.pc());
                Err(Fault::StackOverflow { place, bytes: free.unsigned_abs() as u16 })
            }
            _ if self.bus().uarts.iter().any(|uart| uart.overwritten() > 0) => Err(Fault::LostByte),
            _ => Ok(()),
        }
    }

    /// Bytes between the end of static data and the deepest stack so far. `None` when the image
    /// does not say where its static data ends.
    pub fn free_stack(&self) -> Option<i32> {
        let end = self.image.static_end;
        let sp = self.meters.lowest_sp()?;
        (end != 0).then(|| i32::from(sp) + 1 - i32::from(end))
    }

    /// Cycles since power-up.
    pub fn cycle(&self) -> u64 {
        self.cpu.cycle()
    }

    /// Cycles in so many milliseconds.
    pub fn cycles(&self, ms: u64) -> u64 {
        ms * u64::from(self.clock_hz) / 1000
    }

    /// Seconds that so many cycles take.
    pub fn seconds(&self, cycles: u64) -> f64 {
        cycles as f64 / f64::from(self.clock_hz)
    }

    /// The board.
    ///
    /// # Panics
    /// If it is a chip alone.
    pub fn board(&self) -> &'static Board {
        self.board.expect("a chip on a board")
    }

    /// The chip.
    pub fn chip(&self) -> &'static Chip {
        self.chip
    }

    /// The firmware.
    pub fn image(&self) -> &Image {
        &self.image
    }

    /// Resets that the watchdog has made.
    pub fn resets(&self) -> u64 {
        self.resets
    }

    /// The step and direction pins.
    pub fn recorder(&self) -> &Recorder {
        &self.bus().recorder
    }

    /// The recorder of the step and direction pins, to be cleared or told to keep a log.
    pub fn recorder_mut(&mut self) -> &mut Recorder {
        &mut self.bus_mut().recorder
    }

    /// Begins a VCD file, or ends it with `None`. Returns the file that was being written before.
    pub fn set_trace(&mut self, trace: Option<Trace>) -> Option<Trace> {
        self.bus_mut().recorder.set_trace(trace)
    }

    /// The meters.
    pub fn meters(&self) -> &Meters {
        &self.meters
    }

    /// The meters, to be cleared.
    pub fn meters_mut(&mut self) -> &mut Meters {
        &mut self.meters
    }

    /// One of the USARTs.
    pub fn uart(&self, index: usize) -> &Uart {
        &self.bus().uarts[index]
    }

    /// Whether the first USART takes bytes now: its receiver is on, and interrupts are.
    pub fn is_listening(&self) -> bool {
        self.uart(0).is_listening() && self.cpu.interrupts_on()
    }

    /// Number of CTC tops of the step timer that were written when the counter had already passed them.
    pub fn missed_tops(&self) -> u64 {
        self.bus().timers[self.board().step_timer as usize].missed()
    }

    /// A byte of the data space, as memory holds it.
    pub fn peek(&self, addr: u16) -> u8 {
        self.cpu.data(usize::from(addr))
    }

    /// A byte of the data space, as memory holds it; `None` beyond the end of RAM.
    pub fn data(&self, addr: u16) -> Option<u8> {
        (usize::from(addr) <= self.cpu.data_end()).then(|| self.peek(addr))
    }

    /// A byte of the flash.
    pub fn flash(&self, addr: u32) -> u8 {
        self.cpu.opcode(addr & !1).to_le_bytes()[addr as usize & 1]
    }

    /// Byte address of the next instruction.
    pub fn pc(&self) -> u32 {
        self.cpu.pc()
    }

    /// The stack pointer.
    pub fn sp(&self) -> u16 {
        self.cpu.sp()
    }

    /// The status register.
    pub fn sreg(&self) -> u8 {
        self.cpu.sreg()
    }

    /// Stores a byte in a register or in RAM, with the side effects of a store by the firmware. Tests use it to
    /// corrupt the firmware's state or to make it look old.
    pub fn poke(&mut self, addr: u16, value: u8) {
        match addr >= self.chip.ram_start {
            true => self.cpu.set_data(usize::from(addr), value),
            false => self.bus_mut().store(addr, value),
        }
    }

    /// Withholds an interrupt of a USART from service, or releases it. This holds up what runs in the interrupt.
    pub fn withhold(&mut self, vector: u8, withheld: bool) {
        self.bus_mut().withhold(vector, withheld);
    }

    /// A word of the data space, as memory holds it.
    pub fn peek_word(&self, addr: u16) -> u16 {
        u16::from_le_bytes([self.peek(addr), self.peek(addr + 1)])
    }

    /// Drives an input pin of a port from A to L.
    pub fn drive_pin(&mut self, port: char, bit: u8, high: bool) {
        let (driven, levels) = &mut self.driven[usize::from(port as u8 - b'A')];
        let changes = *driven & 1 << bit == 0 || (*levels >> bit & 1 != 0) != high;
        *driven |= 1 << bit;
        *levels = *levels & !(1 << bit) | u8::from(high) << bit;
        self.cpu.drive_pin(port, bit, *driven, *levels);
        if changes {
            self.bus_mut().pin_edge(port, bit, high);
        }
    }

    /// Sets the voltage at a channel of the converter, A0 to A15, mV; the supply has 5,000 mV.
    pub fn set_millivolts(&mut self, channel: u8, millivolts: u32) {
        self.cpu.set_millivolts(channel, millivolts);
    }

    /// Builds a machine around the chip. It is best called before the first instruction.
    pub fn build(&mut self, build: &Build) {
        let mechanics = Mechanics::new(build, self.board());
        let spindle = recorder::attach_spindle(self.bus, self.cpu, self.board(), build.spindle.pwm);
        self.probes.push(spindle);
        self.bus_mut().mechanics = Some(Box::new(mechanics));
        self.bus_mut().refresh_due();
    }

    /// Puts heaters, their sensors and a fan at the pins that the board has for them. It is best called before the
    /// first instruction. Does nothing on a board without such pins.
    pub fn build_heaters(&mut self) {
        let Some(pins) = self.board().heaters else { return };
        self.thermal = Some(Box::new(Thermal::new(pins)));
        let every = self.cycles(EVERY_MS);
        let due = self.cycle();
        let bus = self.bus_mut();
        (bus.heat_every, bus.heat_due) = (every, due);
        bus.refresh_due();
    }

    /// Puts a MAX6675 on SPI, selected by a pin. It is best called before the first instruction.
    pub fn build_max6675(&mut self, select: Pin) {
        let clock_hz = self.clock_hz;
        self.bus_mut().spi.add_max6675(select, clock_hz);
        self.probes.push(recorder::attach_select(self.bus, self.cpu, select));
    }

    /// Puts an SD card with these contents on SPI, if the board has a pin to select it.
    pub fn insert_card(&mut self, image: Vec<u8>, is_high: bool) {
        let Some(select) = self.board().card.map(|card| card.select) else { return };
        let card = SdCard::new(image, is_high, self.clock_hz);
        self.bus_mut().spi.add_card(select, card);
        self.probes.push(recorder::attach_select(self.bus, self.cpu, select));
    }

    /// The SD card, if there is one.
    pub fn card(&mut self) -> Option<&mut SdCard> {
        self.bus_mut().spi.card()
    }

    /// The MAX6675 that a pin selects, if there is one.
    pub fn max6675(&mut self, select: Pin) -> Option<&mut Max6675> {
        self.bus_mut().spi.max6675(select)
    }

    /// The heaters at the board's pins, if there are any.
    pub fn thermal(&self) -> Option<&Thermal> {
        self.thermal.as_deref()
    }

    /// The heaters, to be tampered with.
    pub fn thermal_mut(&mut self) -> Option<&mut Thermal> {
        self.thermal.as_deref_mut()
    }

    /// Drives the spindle with the duty cycle that its pulse-width output has now. It must be called whenever the
    /// width may have changed, because the edges of these pulses are not simulated.
    pub fn follow_pulses(&mut self) {
        if self.mechanics().is_none() {
            return;
        }
        let share = self.pulses().share;
        self.tamper(|mechanics, now| mechanics.drive_spindle(share, now));
    }

    /// The machine around the chip, if there is one.
    pub fn mechanics(&self) -> Option<&Mechanics> {
        self.bus().mechanics.as_deref()
    }

    /// Calls `change` with the machine around the chip, if there is one, and the current cycle.
    pub fn tamper(&mut self, change: impl FnOnce(&mut Mechanics, u64)) {
        let now = self.cycle();
        if let Some(mechanics) = &mut self.bus_mut().mechanics {
            change(mechanics, now);
        }
        self.bus_mut().refresh_due();
    }

    /// Flips a bit in one of `one_in` bytes on their way to the machine, on every port. `None` ends that.
    pub fn spoil_bytes(&mut self, one_in: Option<u64>, seed: u64) {
        self.bus_mut().wires.iter_mut().for_each(|(_, wire)| wire.spoil(one_in, seed));
    }

    /// Removes the stop bit of one of `one_in` bytes on their way to the machine, on every port. `None` ends that.
    pub fn break_frames(&mut self, one_in: Option<u64>, seed: u64) {
        self.bus_mut().wires.iter_mut().for_each(|(_, wire)| wire.break_frames(one_in, seed));
    }

    /// The EEPROM's contents.
    pub fn eeprom(&self) -> &[u8; eeprom::SIZE] {
        self.bus().eeprom.cells()
    }

    /// Bytes written to the EEPROM so far.
    pub fn eeprom_writes(&self) -> u64 {
        self.bus().eeprom.writes()
    }

    /// Replaces the EEPROM's contents. It is best called before the first instruction.
    pub fn set_eeprom(&mut self, cells: &[u8; eeprom::SIZE]) {
        self.bus_mut().eeprom.set_cells(cells);
    }

    /// Connects an output with an input by a wire.
    pub fn connect(&mut self, from: Pin, to: Pin) {
        self.probes.push(recorder::attach_input(self.bus, self.cpu, from, to));
        self.drive_pin(to.port.letter(), to.bit, self.is_high(from));
    }

    /// Connects an output with the pin of a timer's external clock by a wire.
    pub fn clock(&mut self, from: Pin, timer: usize) {
        self.probes.push(recorder::attach_clock(self.bus, self.cpu, from, timer));
    }

    /// A fault: from now on the bits of `mask` in a cell of the EEPROM stay as in `value`, whatever is written.
    pub fn stick_cell(&mut self, address: u16, mask: u8, value: u8) {
        self.bus_mut().eeprom.stick(Stuck { address, mask, value });
    }

    /// A fault: from now on the bits of `mask` in a byte of RAM stay as in `value`, whatever is stored. Each instruction
    /// then costs more time.
    pub fn stick_ram(&mut self, address: u16, mask: u8, value: u8) {
        self.stuck.push(Stuck { address, mask, value });
        self.is_watched = true;
    }

    /// A fault: from now on a timer counts at this share of its right rate, rounded to whole cycles a count; 0: it
    /// stands still, 1: it is right again. The fault outlasts a reset.
    pub fn set_pace(&mut self, timer: usize, pace: f64) {
        self.bus_mut().set_pace(timer, pace);
    }

    /// Sets the speed of the host's side of the serial line.
    pub fn set_baud(&mut self, baud: u32) {
        let clock_hz = self.clock_hz;
        self.bus_mut().wires[USB].1.set_baud(clock_hz, baud);
    }

    /// Makes the host's side of the serial line change its speed whenever the firmware changes its own.
    pub fn follow_speed(&mut self) {
        self.bus_mut().wires[USB].1.follow();
    }

    /// Queues bytes on the serial line; they travel at its speed.
    pub fn send(&mut self, bytes: &[u8]) {
        self.send_to(USB, bytes);
    }

    /// Queues bytes on the line of a port.
    pub fn send_to(&mut self, port: usize, bytes: &[u8]) {
        self.bus_mut().send(port, bytes);
    }

    /// Drives the handshake pin with which the other side of a port stops the firmware from sending.
    pub fn set_cts(&mut self, port: usize, stop: bool) {
        let handshake = self.board().serial[port].handshake.expect("a port with the pins");
        self.drive_pin(handshake.cts.port.letter(), handshake.cts.bit, stop);
    }

    /// Whether the firmware drives a pin high, or would drive it high if it were an output.
    pub fn is_high(&self, pin: Pin) -> bool {
        self.peek(pin.port.address() as u16) & 1 << pin.bit != 0
    }

    /// Queues a real-time character ahead of the bytes that still wait.
    pub fn send_now(&mut self, byte: u8) {
        self.bus_mut().send_first(USB, byte);
    }

    /// Bytes that have come from the machine since the last call.
    pub fn receive(&mut self) -> Vec<u8> {
        self.receive_from(USB)
    }

    /// Bytes that have come from a port since the last call.
    pub fn receive_from(&mut self, port: usize) -> Vec<u8> {
        self.bus_mut().wires[port].1.take_received()
    }

    /// The host's side of the serial line.
    pub fn wire(&self) -> &Wire {
        &self.bus().wires[USB].1
    }

    /// Returns the function name for a flash address; for a vector, the vector's name.
    pub fn place(&self, pc: u32) -> String {
        let vector = pc / 4;
        if pc.is_multiple_of(4) && (1..self.chip.vectors.len() as u32).contains(&vector) {
            return self.chip.vector_name(vector as u8).to_string();
        }
        self.image.function_at(pc)
    }

    /// Describes the place of a window with interrupts off.
    pub fn describe(&self, window: &Window) -> String {
        let (from, to) = (self.place(window.from_pc), self.place(window.to_pc));
        if from == to { from } else { format!("{from} .. {to}") }
    }
}

/// Returns the byte address to which the instruction with these words jumps; `None` if it is no jump.
fn jump(first: u16, second: u16) -> Option<u32> {
    let upper = u32::from(first >> 3 & 0x3E | first & 1);
    (first & 0xFE0E == 0x940C).then_some((upper << 16 | u32::from(second)) * 2)
}

impl Drop for Machine {
    fn drop(&mut self) {
        if let Some(counts) = &self.counts {
            counts.write(self.cpu.cycle());
        }
        self.cpu.power_down();
        // SAFETY: `Bus::install` leaked this box; the CPU that had the pointer is gone.
        drop(unsafe { Box::from_raw(self.bus.as_ptr()) });
    }
}
