//! Start-up, and the commands.
//!
//! Nothing here has a static variable. Those that the image has all the same belong to Kerf's interrupts, which never
//! come, so their bytes are tested like any other. All state is on the stack, which is small: `paint` and the loader
//! leave the RAM between as it was.
#![allow(missing_docs)] // for the items that `avr_device::entry` generates

mod cells;
mod chip;
mod converter;
mod count;
mod duty;
mod echo;
mod line;
mod ram;
mod register;
mod serial;
mod text;
mod timers;

use kerf::baud;
use line::Line;
use text::answer;

kerf::link_libraries!();

#[avr_device::entry]
fn main() -> ! {
    chip::settle();
    serial::start(baud::DEFAULT);
    greet();
    let mut line = Line::new();
    loop {
        line.read();
        if line.text().and_then(carry_out).is_none() {
            answer(b"?", &[]);
        }
    }
}

fn greet() {
    answer(b"kerf-chip 1 atmega2560", &[]);
}

/// Carries out a command. `None` if it is none.
fn carry_out(line: &[u8]) -> Option<()> {
    let mut words = line.split(|byte| *byte == b' ');
    let name = words.next()?;
    match (name, text::number(&mut words)?, text::number(&mut words)?, words.next()) {
        (b"hello", None, None, None) => greet(),
        (b"ram", None, None, None) => {
            let found = ram::test();
            answer(b"ram", &[found.tested, found.bad, found.first]);
        }
        (b"paint", None, None, None) => answer(b"paint", &[ram::paint()]),
        (b"stack", Some(from), None, None) => answer(b"stack", &[ram::painted(from)?]),
        (b"cells", Some(from), Some(count), None) => {
            let (bad, first) = cells::test(from, count)?;
            answer(b"cells", &[from, count, bad, first]);
        }
        (b"count", None, None, None) => answer(b"count", &count::until_byte()),
        (b"rate", Some(bits), Some(count), None) => echo::run(bits, count)?,
        (b"volt", None, None, None) => answer(b"volt", &[converter::supply()]),
        (b"duty", Some(channel), None, None) => answer(b"duty", &duty::readings(channel)?),
        (b"hang", None, None, None) => {
            answer(b"hang", &[]);
            serial::flush();
            chip::hang();
        }
        _ => return None,
    }
    Some(())
}
