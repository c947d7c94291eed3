//! The vector table, in RAM, with our own handler for edges at pins.
//!
//! The handler of `embassy-rp` for edges wakes tasks. A limit switch has to stop the steps within 10 us, whatever
//! tasks do, so our own handler replaces it.

use crate::hal::Boot;
use core::cell::UnsafeCell;

use embassy_rp::interrupt::IO_IRQ_BANK0;

/// Exceptions before the first interrupt.
const EXCEPTIONS: usize = 16;
/// Interrupts of the chip.
const INTERRUPTS: usize = 32;

/// The table. It is aligned because the register with its address has no lower bits.
#[repr(C, align(256))]
struct Table(UnsafeCell<[u32; EXCEPTIONS + INTERRUPTS]>);

// SAFETY: only start-up writes it.
unsafe impl Sync for Table {}

static TABLE: Table = Table(UnsafeCell::new([0; EXCEPTIONS + INTERRUPTS]));

/// The register with the address of the table.
const VTOR: *mut u32 = 0xE000_ED08 as *mut u32;

/// Copies the table to RAM, and has the CPU use the copy.
pub(super) fn move_to_ram(_: &Boot) {
    let edges = EXCEPTIONS + IO_IRQ_BANK0 as usize;
    // SAFETY: this runs before any handler of ours is enabled. VTOR points to the table at the beginning of the
    // image, which has as many words.
    unsafe {
        let table = TABLE.0.get().cast::<u32>();
        let first = VTOR.read_volatile() as *const u32;
        for i in 0..EXCEPTIONS + INTERRUPTS {
            table.add(i).write_volatile(first.add(i).read_volatile());
        }
        table.add(edges).write_volatile(super::inputs::edges as *const () as u32);
        VTOR.write_volatile(table as u32);
    }
    cortex_m::asm::dsb();
}
