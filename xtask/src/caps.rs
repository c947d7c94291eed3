//! What a firmware image may take: the one place where these limits stand.
//!
//! Raise a cap only together with the reason for it.

/// Flash: what today's capabilities take on the board of the lathe, which leaves out grbl's dialect (21,000), help and built-in jobs (3,800). Turning
/// takes 25,000 of it: G76 6,000, for its words, its geometry and powers of floats, G33.1 3,300, X that leaves the cut in what is queued already 600. The chip has 253,952, which its largest
/// boot loader, 8 KiB, leaves: the rest is not for what is to come, that has to find its room. Calls through a pointer reach 128 KiB; the
/// linker leads those that go further through jumps at the beginning of the image (`.trampolines`). The last 300 are for the board of the printer: the watchdog
/// looks whether ticks interrupt, G-code waits for the end of a jog, motors of very fine steps merge no lines, and exec makes a usual segment where a
/// long one does not fit (200).
pub const FLASH: u64 = 253_700;
/// `.data`: constants that landed in RAM; tables and text belong in program memory. In the image with an SD card the messages of `embedded-sdmmc`,
/// which nobody reads, take 240 of it; the others have less than 400.
pub const DATA: u64 = 500;
/// `.data` and `.bss` together, of the chip's 8192 bytes: the velocities beside the keys of the look-ahead take 130, and the
/// stack has its 400 beside them. Surface speed takes the last of it, on the board of the lathe, and whether lines are merged 8 more: statics end at a
/// multiple of 8.
pub const STATIC_RAM: u64 = 6_072;
/// What must be left between the statics and the deepest stack by analysis.
pub const FREE_STACK: i64 = 400;

/// RAM of the ATmega2560.
pub const RAM: u64 = 8_192;

/// Tasks that run on the interrupt-mode executor, by the names of their functions in `src/app.rs` up to
/// `_task`; every other task runs in thread mode.
pub const INTERRUPT_TASKS: &[&str] = &["exec"];
