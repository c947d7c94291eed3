//! The limits of what a firmware image may take. They are in this file only.
//!
//! Raise a cap only together with the reason for it.

/// Bytes of flash. The boot loader of the Arduino Mega erases pages up to 245,760 only: it cannot update a larger image,
/// because it programs the pages beyond over their old content. The difference is a reserve. What has no room is left
/// out of an image by its board's file ([`Capability`](kerf::capability::Capability)). Canned cycles take 6,000 bytes,
/// those of them that act on the spindle about 1,000; text mode of TinyG's dialect, the dialect of grbl, and that of
/// TinyG without text mode about 20,000 each; turning takes 25,000, of which G76 takes 6,000 and G33.1 3,300; help and
/// built-in jobs take 3,800, probing 1,330.
pub const FLASH: u64 = 243_000;
/// Bytes that the profile of an image may add to its flash, beside an image for the machine `careful`: two calls, and
/// entries that lead from its own defaults back to those of `careful` (`config::machines::ADDS`). `cargo xtask test`
/// measures them on one board. Each other board must leave so much room that it fits with every profile.
pub const PROFILE: u64 = 100;
/// Bytes of `.data`: constants that the compiler has put into RAM. Tables and text belong in program memory.
pub const DATA: u64 = 500;
/// Bytes of `.data` and `.bss` together, of the chip's 8192. The means of motion take 310 bytes, and the deepest stack
/// has become 230 bytes less. [`FREE_STACK`] remains beside the cap. The image for the board of the lathe reaches the cap: surface speed
/// has taken the last free bytes. The flag that says whether lines are merged takes 8 more, because statics end at a
/// multiple of 8. The position of the last probing on the axes that do not probe, and whether the last line moves, take
/// 16 together. The work offset, the coordinate system and the tool of the move that runs take 18 bytes in exec's
/// snapshot, and as much in the copy that a report on each port keeps, with the outputs and S. Tool numbers of two bytes
/// take 8 more.
pub const STATIC_RAM: u64 = 6_200;
/// Bytes that must remain between the statics and the deepest stack found by analysis.
pub const FREE_STACK: i64 = 400;

/// RAM of the ATmega2560, bytes.
pub const RAM: u64 = 8_192;

/// Tasks that run on the interrupt-mode executor, by the names of their functions in `src/app.rs` up to
/// `_task`; every other task runs in thread mode.
pub const INTERRUPT_TASKS: &[&str] = &["exec"];
