//! Pins behind shift registers (74HC595). This module sets up state machines that send bits to a chain of them, and owns
//! the chain of the outputs that are not steps: [`Port::Outputs`](crate::boards::Port::Outputs).
//!
//! A change of one output sends all of them, and the latch sets all at once, so that no other output moves. The state
//! machine of PIO1 does that by itself: 1.1 us for 16 outputs. Its FIFO has room for eight changes; who finds it full
//! waits for 1.1 us at most.
//!
//! A register has anything at power-up, and keeps its outputs over a reset of the chip, until [`early`](super::early)
//! switches them off.
//!
//! Exec sets outputs, or other levels while exec cannot run; the panic handler may do so in the midst of that.

use core::sync::atomic::{AtomicU32, Ordering::Relaxed};

use embassy_rp::pac::PIO1;
use embassy_rp::pac::pio::Pio;
use embassy_rp::pio::program::{Program, RP2040_MAX_PROGRAM_SIZE, pio_asm};

use super::gpio::{self, Unit};
use crate::boards::{ACTIVE, Pin, Port, ShiftRegister};
use crate::hal::{Boot, Exclusive};

/// The number of the state machine, of PIO1's four.
const SM: usize = 0;
/// How often [`send`] looks at most for room; each time takes some cycles, and a change 140.
const POLLS: u16 = 1_000;
/// `set pins, 0`, `set pindirs, 1`.
const SET_PINS: u16 = 0b111_00000_000_00000;
const SET_PINDIRS: u16 = 0b111_00000_100_00001;

/// The levels of the outputs, as bits.
static LEVELS: AtomicU32 = AtomicU32::new(SAFE);

/// Drivers off, everything else low.
pub(super) const SAFE: u32 = {
    let mut levels = enable(ACTIVE.enable_all);
    let mut m = 0;
    while m < ACTIVE.motors.len() {
        levels |= enable(ACTIVE.motors[m].enable);
        m += 1;
    }
    levels
};

const fn enable(pin: Option<Pin>) -> u32 {
    match pin {
        Some(Pin { port: Port::Outputs, bit }) => 1 << bit,
        _ => 0,
    }
}

/// Loads a program, which begins at address 0.
pub(super) fn load(_: &Boot, pio: Pio, sm: usize, program: &Program<RP2040_MAX_PROGRAM_SIZE>) {
    for (i, instruction) in program.code.iter().enumerate() {
        pio.instr_mem(i).write(|w| w.set_instr_mem(*instruction));
    }
    pio.sm(sm).execctrl().write(|w| {
        w.set_wrap_bottom(program.wrap.target);
        w.set_wrap_top(program.wrap.source);
    });
}

/// Has a state machine drive a pin low from now on.
pub(super) fn drive_low(_: &Boot, pio: Pio, sm: usize, pin: Pin) {
    let sm = pio.sm(sm);
    sm.pinctrl().write(|w| {
        w.set_set_base(pin.bit);
        w.set_set_count(1);
    });
    // Instructions that the state machine carries out at once.
    for instruction in [SET_PINS, SET_PINDIRS] {
        sm.instr().write(|w| w.set_instr(instruction));
    }
}

/// Connects a chain to a state machine: data by `out pins`, clock and latch by side-set. Words are shifted out from the
/// right; `jmp !osre` counts the outputs.
pub(super) fn connect(boot: &Boot, pio: Pio, sm: usize, chain: ShiftRegister, unit: Unit) {
    for pin in [chain.data, chain.clock, chain.latch] {
        drive_low(boot, pio, sm, pin);
        gpio::connect_output(pin, unit);
    }
    let sm = pio.sm(sm);
    sm.shiftctrl().write(|w| {
        w.set_out_shiftdir(true);
        w.set_in_shiftdir(true);
        w.set_pull_thresh(chain.outputs);
    });
    sm.pinctrl().write(|w| {
        w.set_out_base(chain.data.bit);
        w.set_out_count(1);
        w.set_sideset_base(chain.clock.bit);
        w.set_sideset_count(2);
    });
}

/// Starts the state machine of the outputs, which are off.
pub(super) fn start(boot: &Boot) {
    let Some(registers) = ACTIVE.registers else { return };
    let program = pio_asm!(
        ".origin 0",
        ".side_set 2",
        ".wrap_target",
        "    pull block       side 0",
        "bit:",
        "    out pins, 1      side 0 [3]",
        "    jmp !osre bit    side 1 [3]",
        "    nop              side 2 [3]",
        ".wrap",
    );
    PIO1.sm(SM).clkdiv().write(|w| w.set_int(1));
    load(boot, PIO1, SM, &program.program);
    connect(boot, PIO1, SM, registers.outputs, Unit::Pio1);
    // Eight words.
    PIO1.sm(SM).shiftctrl().modify(|w| w.set_fjoin_tx(true));
    PIO1.ctrl().write(|w| w.set_sm_enable(1 << SM));
    send(SAFE);
}

/// Drives an output high or low.
pub(super) fn set(_: Exclusive<'_>, output: u8, high: bool) {
    let levels = LEVELS.load(Relaxed) & !(1 << output) | u32::from(high) << output;
    LEVELS.store(levels, Relaxed);
    send(levels);
}

/// Sends the levels of all outputs. The last output is sent first, because it is at the end of the chain.
fn send(levels: u32) {
    let Some(registers) = ACTIVE.registers else { return };
    for _ in 0..POLLS {
        if PIO1.fstat().read().txfull() & 1 << SM == 0 {
            break;
        }
    }
    let word = levels.reverse_bits() >> (32 - registers.outputs.outputs);
    PIO1.txf(SM).write_value(word);
}
