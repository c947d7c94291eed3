//! The CPU core of simavr behind a small handle.
//!
//! simavr supplies the instructions, the ports, the ADC and the watchdog. Nearly all the unsafe
//! code of this crate is here; the rest is the callbacks in `bus` and `recorder`.

use std::ffi::{c_int, c_void};
use std::ptr::NonNull;

use anyhow::{Result, bail};
use simavr_ffi as ffi;

use crate::chip::Chip;
use crate::image::Image;

/// Stack pointer, low byte; the high byte follows.
const SPL: usize = 0x5D;
/// Sleep mode control register; bit 0 is the sleep enable.
const SMCR: usize = 0x53;
/// Which reset was the last.
const MCUSR: usize = 0x54;
/// The bit of MCUSR that tells of a reset by the button.
const EXTERNAL: u8 = 1 << 1;
/// The upper bits of addresses of bytes in flash.
const RAMPZ: usize = 0x5B;
/// Index of the I flag in simavr's unpacked status register.
const FLAG_I: usize = 7;

// libsimavr exports this function, but the bindings leave it out.
unsafe extern "C" {
    fn avr_run_one(avr: *mut ffi::avr_t) -> u32;
    fn _avr_push_addr(avr: *mut ffi::avr_t, addr: u32) -> c_int;
}

/// What the CPU is doing.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Mode {
    /// Executing.
    Running,
    /// Waiting for an interrupt.
    Sleeping,
    /// Stopped for good by an instruction that cannot be executed.
    Crashed,
}

/// A handle to simavr's CPU. It is copied freely; the machine keeps the core alive.
#[derive(Clone, Copy)]
pub struct Cpu(NonNull<ffi::avr_t>);

/// Called for SBI and CBI: core, bit, new value, parameter. Returns 1 when it has done the write.
pub type BitWrite = unsafe extern "C" fn(*mut ffi::avr_t, u8, u8, *mut c_void) -> c_int;

/// simavr calls this to wait in real time. It returns at once, because simulated time never waits.
extern "C" fn no_sleep(_: *mut ffi::avr_t, _: u64) {}

/// simavr calls this for an instruction that does not exist.
unsafe extern "C" fn bad_instruction(_: *mut ffi::avr_irq_t, _: u32, avr: *mut c_void) {
    // SAFETY: `power_up` registered the core itself as the parameter.
    unsafe { (*avr.cast::<ffi::avr_t>()).state = ffi::cpu_Crashed as c_int }
}

impl Cpu {
    /// Returns a powered-up chip with the image in its flash.
    pub fn power_up(image: &Image, chip: &Chip, clock_hz: u32) -> Result<Self> {
        // SAFETY: the name is a C string; simavr returns null or a core that nothing else uses.
        let made = unsafe { ffi::avr_make_mcu_by_name(chip.name.as_ptr()) };
        let Some(avr) = NonNull::new(made) else { bail!("simavr has no {:?}", chip.name) };
        let p = avr.as_ptr();
        // SAFETY: `p` is a fresh core; the flash that `avr_init` allocates has `flashend + 1` bytes.
        unsafe {
            (*p).frequency = clock_hz;
            ffi::avr_init(p);
            (*p).frequency = clock_hz;
            (*p).sleep = Some(no_sleep);
            (*p).avcc = 5_000;
            (*p).set_log(0);
            let bad = (*p).irq.add(ffi::AVR_CORE_BAD_OPCODE as usize);
            ffi::avr_irq_register_notify(bad, Some(bad_instruction), p.cast());
            let size = (*p).flashend as usize + 1;
            if image.flash.len() > size {
                bail!("the image has {} bytes, the flash {size}", image.flash.len());
            }
            std::ptr::copy_nonoverlapping(image.flash.as_ptr(), (*p).flash, image.flash.len());
        }
        Ok(Cpu(avr))
    }

    /// Frees the memory of flash and RAM. The handle and its copies are dead afterwards.
    pub fn power_down(self) {
        // SAFETY: called once, by the machine that owns the core, when it is dropped.
        unsafe { ffi::avr_terminate(self.0.as_ptr()) }
    }

    fn p(self) -> *mut ffi::avr_t {
        self.0.as_ptr()
    }

    /// Puts bytes into the flash. What lies beyond its end is ignored.
    pub fn set_flash(self, addr: u32, bytes: &[u8]) {
        // SAFETY: the end of the bytes is checked against the end of the flash.
        unsafe {
            if addr as usize + bytes.len() <= (*self.p()).flashend as usize + 1 {
                let to = (*self.p()).flash.add(addr as usize);
                std::ptr::copy_nonoverlapping(bytes.as_ptr(), to, bytes.len());
            }
        }
    }

    /// Sets the address at which the chip starts after a reset.
    pub fn set_start(self, addr: u32) {
        // SAFETY: the machine keeps the core alive; plain write.
        unsafe { (*self.p()).reset_pc = addr }
    }

    /// Resets the chip as the button does, which sets the flag of an external reset. RAM keeps its contents, and cycles
    /// are counted on.
    pub fn reset(self) {
        let now = self.cycle();
        // SAFETY: the core is initialised, and executes no instruction now.
        unsafe { ffi::avr_reset(self.p()) };
        self.set_cycle(now);
        self.set_data(MCUSR, self.data(MCUSR) | EXTERNAL);
    }

    /// Calls `io` for SPM and for each read of the flash by LPM, ahead of simavr's own self-programming.
    pub fn take_over_flash(self, io: *mut ffi::avr_io_t) {
        // SAFETY: the caller keeps `io` valid as long as the core; the list of parts ends with null.
        unsafe {
            (*io).avr = self.p();
            (*io).next = (*self.p()).io_port;
            (*self.p()).io_port = io;
        }
    }

    /// The address of a byte of flash in the registers RAMPZ and Z.
    pub fn z(self) -> u32 {
        u32::from_le_bytes([self.data(30), self.data(31), self.data(RAMPZ), 0])
    }

    /// The word in r0 and r1, which SPM stores.
    pub fn word_of_program(self) -> u16 {
        u16::from_le_bytes([self.data(0), self.data(1)])
    }

    /// Cycles since power-up.
    #[inline]
    pub fn cycle(self) -> u64 {
        // SAFETY: the machine keeps the core alive; plain read.
        unsafe { (*self.p()).cycle }
    }

    /// Sets the cycle counter.
    #[inline]
    pub fn set_cycle(self, cycle: u64) {
        // SAFETY: the machine keeps the core alive; plain write.
        unsafe { (*self.p()).cycle = cycle }
    }

    /// Byte address of the next instruction.
    #[inline]
    pub fn pc(self) -> u32 {
        // SAFETY: the machine keeps the core alive; plain read.
        unsafe { (*self.p()).pc }
    }

    /// The status register.
    pub fn sreg(self) -> u8 {
        // SAFETY: the machine keeps the core alive; plain reads.
        let flags = unsafe { (*self.p()).sreg };
        (0..).zip(flags).fold(0, |bits, (n, flag)| bits | u8::from(flag != 0) << n)
    }

    /// The highest address of the data space.
    pub fn data_end(self) -> usize {
        // SAFETY: the machine keeps the core alive; plain read.
        unsafe { (*self.p()).ramend as usize }
    }

    #[inline]
    fn set_pc(self, pc: u32) {
        // SAFETY: the machine keeps the core alive; plain write.
        unsafe { (*self.p()).pc = pc }
    }

    /// Executes one instruction.
    #[inline]
    pub fn execute(self) {
        // SAFETY: the core is initialised; its callbacks are those of simavr and of `Bus`.
        let pc = unsafe { avr_run_one(self.p()) };
        self.set_pc(pc);
    }

    /// The instruction word at a byte address; 0 beyond the flash.
    #[inline]
    pub fn opcode(self, pc: u32) -> u16 {
        // SAFETY: the address is checked against the end of the flash.
        unsafe {
            if pc >= (*self.p()).flashend {
                return 0;
            }
            (*self.p()).flash.add(pc as usize).cast::<u16>().read_unaligned().to_le()
        }
    }

    /// Cycles of the load or store that is being executed.
    pub fn access_cycles(self) -> u64 {
        // IN and OUT take one; LD, ST, LDS, STS, SBI and CBI take two.
        if self.opcode(self.pc()) & 0xF000 == 0xB000 { 1 } else { 2 }
    }

    /// When the store that is being executed takes effect.
    pub fn write_cycle(self) -> u64 {
        self.cycle() + self.access_cycles()
    }

    /// When the load that is being executed samples.
    pub fn read_cycle(self) -> u64 {
        self.cycle() + self.access_cycles() - 1
    }

    /// A byte of the data space.
    #[inline]
    pub fn data(self, addr: usize) -> u8 {
        // SAFETY: the address is checked against the end of RAM.
        unsafe {
            assert!(addr <= (*self.p()).ramend as usize, "no such data address");
            *(*self.p()).data.add(addr)
        }
    }

    /// Sets a byte of the data space, without side effects.
    #[inline]
    pub fn set_data(self, addr: usize, value: u8) {
        // SAFETY: the address is checked against the end of RAM.
        unsafe {
            assert!(addr <= (*self.p()).ramend as usize, "no such data address");
            *(*self.p()).data.add(addr) = value;
        }
    }

    /// The stack pointer.
    #[inline]
    pub fn sp(self) -> u16 {
        // SAFETY: both bytes are inside the data space of every chip.
        unsafe { (*self.p()).data.add(SPL).cast::<u16>().read_unaligned().to_le() }
    }

    /// Whether interrupts are on.
    #[inline]
    pub fn interrupts_on(self) -> bool {
        // SAFETY: the machine keeps the core alive; plain read.
        unsafe { (*self.p()).sreg[FLAG_I] != 0 }
    }

    /// Whether the instruction just executed set the I flag; one more runs before an interrupt.
    #[inline]
    pub fn take_shadow(self) -> bool {
        // SAFETY: the machine keeps the core alive; simavr's own interrupt service is not used, so
        // its state is only this mark.
        unsafe {
            let shadow = (*self.p()).interrupt_state < 0;
            (*self.p()).interrupt_state = 0;
            shadow
        }
    }

    /// What the CPU is doing. A sleep instruction without the sleep enable bit does nothing.
    #[inline]
    pub fn mode(self) -> Mode {
        // SAFETY: the machine keeps the core alive; plain read.
        let state = unsafe { (*self.p()).state } as u32;
        match state {
            ffi::cpu_Running => Mode::Running,
            ffi::cpu_Sleeping if self.data(SMCR) & 1 == 0 => {
                self.wake();
                Mode::Running
            }
            ffi::cpu_Sleeping => Mode::Sleeping,
            _ => Mode::Crashed,
        }
    }

    /// Ends a sleep.
    pub fn wake(self) {
        // SAFETY: the machine keeps the core alive; plain write.
        unsafe { (*self.p()).state = ffi::cpu_Running as c_int }
    }

    /// When simavr's own peripherals (watchdog, ADC, EEPROM) want to be called next.
    #[inline]
    pub fn native_due(self) -> u64 {
        // SAFETY: the machine keeps the core alive; the list node is null or in the core's pool.
        unsafe {
            let head = (*self.p()).cycle_timers.timer;
            if head.is_null() { u64::MAX } else { (*head).when }
        }
    }

    /// Calls simavr's own peripherals. Returns true when the watchdog has reset the core.
    pub fn run_native(self) -> bool {
        let now = self.cycle();
        // SAFETY: the core is initialised.
        unsafe { ffi::avr_cycle_timer_process(self.p()) };
        let reset = self.cycle() < now;
        if reset {
            self.set_cycle(now);
        }
        reset
    }

    /// Number of nested interrupts that are being served.
    #[inline]
    pub fn depth(self) -> u8 {
        // SAFETY: the machine keeps the core alive; plain read.
        unsafe { (*self.p()).interrupts.running_ptr }
    }

    /// Enters an interrupt: pushes the return address, clears I, jumps to the vector. Charges no cycles. Returns
    /// false when the nesting is deeper than in any real program.
    pub fn enter(self, vector: u8) -> bool {
        let p = self.p();
        // SAFETY: the core is initialised; the index into `running` is checked.
        unsafe {
            _avr_push_addr(p, (*p).pc);
            (*p).sreg[FLAG_I] = 0;
            (*p).interrupt_state = 0;
            (*p).pc = u32::from(vector) * u32::from((*p).vector_size);
        }
        self.adopt(vector)
    }

    /// Counts a handler that was called instead of entered. Returns false when the nesting is deeper than in any real
    /// program.
    pub fn adopt(self, vector: u8) -> bool {
        let p = self.p();
        // SAFETY: the core is initialised; the index into `running` is checked.
        unsafe {
            let depth = (*p).interrupts.running_ptr as usize;
            if depth >= (*p).interrupts.running.len() {
                return false;
            }
            // RETI removes this entry again. simavr only notifies listeners with it, and there are none.
            (*p).interrupts.running[depth] = self.find_vector(vector);
            (*p).interrupts.running_ptr += 1;
        }
        true
    }

    fn find_vector(self, vector: u8) -> *mut ffi::avr_int_vector_t {
        // SAFETY: simavr filled the first `vector_count` entries with live vectors.
        unsafe {
            let table = &raw mut (*self.p()).interrupts;
            let n = (*table).vector_count as usize;
            (0..n)
                .map(|i| (*table).vector[i])
                .find(|v| (**v).vector == vector)
                .unwrap_or((*table).vector[0])
        }
    }

    /// Whether one of simavr's own peripherals has an interrupt pending.
    #[inline]
    pub fn native_pending(self) -> bool {
        // SAFETY: the machine keeps the core alive; plain reads.
        unsafe {
            let q = &raw const (*self.p()).interrupts.pending;
            (*q).read != (*q).write
        }
    }

    /// Returns the most urgent interrupt that simavr's own peripherals have pending, if it is enabled. Forgets
    /// interrupts that were cleared or disabled since they were raised.
    pub fn native_vector(self) -> Option<u8> {
        let p = self.p();
        let mut best: Option<u8> = None;
        // SAFETY: entries between `read` and `write` are live vectors of this core.
        unsafe {
            let q = &raw mut (*p).interrupts.pending;
            let n = ((*q).write.wrapping_sub((*q).read) & 63) as usize;
            let mut kept = 0;
            for i in 0..n {
                let v = (*q).buffer[((*q).read as usize + i) & 63];
                let enable = (*v).enable;
                let on = self.data(enable.reg() as usize) >> enable.bit() & 1 != 0;
                if (*v).pending() == 0 || !on {
                    (*v).set_pending(0);
                    continue;
                }
                (*q).buffer[((*q).read as usize + kept) & 63] = v;
                kept += 1;
                best = Some(best.map_or((*v).vector, |b: u8| b.min((*v).vector)));
            }
            (*q).write = ((*q).read as usize + kept) as u16 & 63;
        }
        best
    }

    /// Acknowledges an interrupt of one of simavr's own peripherals.
    pub fn native_acknowledge(self, vector: u8) {
        // SAFETY: the vector is one of this core's.
        unsafe { ffi::avr_clear_interrupt(self.p(), self.find_vector(vector)) }
    }

    /// Routes the accesses to an I/O register to callbacks. `None` leaves the register plain memory.
    pub fn hook(
        self,
        addr: u16,
        read: ffi::avr_io_read_t,
        write: ffi::avr_io_write_t,
        param: *mut c_void,
    ) {
        let io = addr as usize - 32;
        // SAFETY: the index is bounds-checked; the caller keeps `param` valid as long as the core.
        unsafe {
            (*self.p()).io[io].r.c = read;
            (*self.p()).io[io].r.param = param;
            (*self.p()).io[io].w.c = write;
            (*self.p()).io[io].w.param = param;
            if io < 32 {
                // Without a bit callback, SBI and CBI do a read, a change and a write.
                (*self.p()).bit_io[io].c = None;
            }
        }
    }

    /// Routes SBI and CBI on one of the 32 low I/O registers to a callback.
    pub fn hook_bits(self, addr: u16, write: BitWrite, param: *mut c_void) {
        let io = addr as usize - 32;
        // SAFETY: the index is bounds-checked; the caller keeps `param` valid as long as the core.
        unsafe {
            (*self.p()).bit_io[io].c = Some(write);
            (*self.p()).bit_io[io].param = param;
        }
    }

    /// Calls `notify` at each change of a pin's level.
    pub fn watch_pin(self, port: char, bit: u8, notify: ffi::avr_irq_notify_t, param: *mut c_void) {
        // SAFETY: the caller keeps `param` valid as long as the core.
        unsafe { ffi::avr_irq_register_notify(self.pin(port, bit), notify, param) }
    }

    /// Sets the voltage at a channel of the converter, mV; the supply has 5,000 mV.
    pub fn set_millivolts(self, channel: u8, millivolts: u32) {
        let ctl = u32::from_be_bytes(*b"adc0");
        let index = ffi::ADC_IRQ_ADC0 as c_int + c_int::from(channel);
        // SAFETY: simavr returns null for what it does not know, which it ignores.
        unsafe { ffi::avr_raise_irq(ffi::avr_io_getirq(self.p(), ctl, index), millivolts) }
    }

    /// Drives an input pin from outside. `driven` are the pins of its port that are driven at all, and `levels` are
    /// their levels. Both are needed because simavr would otherwise let the pull-up win whenever the port is written.
    pub fn drive_pin(self, port: char, bit: u8, driven: u8, levels: u8) {
        // SAFETY: three numbers, for which 0 is a value.
        let mut external: ffi::avr_ioport_external_t = unsafe { std::mem::zeroed() };
        external.set_mask(driven.into());
        external.set_value(levels.into());
        let ctl = u32::from_be_bytes([b'i', b'o', b'p', port as u8]);
        // SAFETY: simavr copies what it needs; the IRQ belongs to this core.
        unsafe {
            ffi::avr_ioctl(self.p(), ctl, (&raw mut external).cast());
            ffi::avr_raise_irq(self.pin(port, bit), u32::from(levels >> bit & 1));
        }
    }

    fn pin(self, port: char, bit: u8) -> *mut ffi::avr_irq_t {
        let ctl = u32::from_be_bytes([b'i', b'o', b'g', port as u8]);
        // SAFETY: simavr checks the request and returns null for what it does not know; null is
        // ignored by the functions that take an IRQ.
        unsafe { ffi::avr_io_getirq(self.p(), ctl, c_int::from(bit)) }
    }
}
