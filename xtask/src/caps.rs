//! The limits of what a firmware image may take. They are in this file only.
//!
//! Raise a cap only together with the reason for it.

/// Bytes of flash. The cap is the size of the image for the board of the lathe with today's capabilities. That image
/// leaves out grbl's dialect (21,000), help and built-in jobs (3,800). Turning takes 25,000 of it: G76 takes 6,000, for
/// its words, its geometry and powers of floats; G33.1 takes 3,300; the retract of X within moves that are already
/// queued takes 600. The chip has 253,952 bytes beside its largest boot loader, 8 KiB. The difference is no reserve for
/// new features: they have to make room. Calls through a pointer reach 128 KiB; the linker routes longer calls through
/// jumps at the beginning of the image (`.trampolines`). The last 300 bytes are for the board of the printer: the
/// watchdog checks whether ticks interrupt, G-code waits for the end of a jog, motors with very fine steps merge no
/// lines, and exec makes a normal segment where a long one does not fit (200). Another 100 are for two limits: that of
/// a move which is too short for a ramp, and those of an arc whose path is measured in degrees.
pub const FLASH: u64 = 253_800;
/// Bytes that the profile of an image may add to its flash, beside an image for the machine `careful`: two calls, and
/// entries that lead from its own defaults back to those of `careful` (`config::machines::ADDS`). `cargo xtask test`
/// measures them on one board. Each other board must leave so much room that it fits with every profile.
pub const PROFILE: u64 = 100;
/// Bytes of `.data`: constants that the compiler has put into RAM. Tables and text belong in program memory.
pub const DATA: u64 = 500;
/// Bytes of `.data` and `.bss` together, of the chip's 8192. The velocities beside the keys of the look-ahead take 130
/// bytes. [`FREE_STACK`] remains beside the cap. The image for the board of the lathe reaches the cap: surface speed
/// has taken the last free bytes. The flag that says whether lines are merged takes 8 more, because statics end at a
/// multiple of 8. The position of the last probing on the axes that do not probe, and whether the last line moves, take
/// 16 together. The work offset, the coordinate system and the tool of the move that runs take 18 bytes in exec's
/// snapshot, and as much in the copy that a report on each port keeps, with the outputs and S. Tool numbers of two bytes
/// take 8 more.
pub const STATIC_RAM: u64 = 6_152;
/// Bytes that must remain between the statics and the deepest stack found by analysis.
pub const FREE_STACK: i64 = 400;

/// RAM of the ATmega2560, bytes.
pub const RAM: u64 = 8_192;

/// Tasks that run on the interrupt-mode executor, by the names of their functions in `src/app.rs` up to
/// `_task`; every other task runs in thread mode.
pub const INTERRUPT_TASKS: &[&str] = &["exec"];
