//! The reader task: bytes from the receive ring into the line pool.
//!
//! Reads the receive ring, writes the line pool, waits on [`Event::Received`] or for pool space; never
//! runs longer than the ring is full (255 bytes, about 6,000 cycles). When the pool is full the bytes
//! stay in the ring, and when that is full too the line is damaged and refused: see `lines`.

use embassy_futures::yield_now;

use super::links::Links;
use crate::hal::event::{Event, wait};
use crate::hal::imp::uart::losing;
use crate::hal::serial::{LOSS, LOSS_AT_END, Received};
use crate::protocol::Mode;
use crate::status::Status;

/// Pieces taken before others get a turn: a piece is a line, or a part of one, and its end.
const TURN: usize = 16;

/// What a turn came to.
#[derive(PartialEq, Eq)]
enum Left {
    Nothing,
    Bytes,
    /// Bytes, and no room in the pool.
    Full,
}

/// The task.
pub async fn run(links: &'static Links, mut received: Received) -> ! {
    let mut told = false;
    loop {
        wait(Event::Received, || (!received.is_empty()).then_some(())).await;
        match take_some(links, &mut received, &mut told) {
            Left::Nothing => {}
            Left::Bytes => yield_now().await,
            Left::Full => links.pool_space.wait().await,
        }
    }
}

/// Takes a turn's bytes.
fn take_some(links: &Links, received: &mut Received, told: &mut bool) -> Left {
    let mut pool = links.lines.borrow_mut();
    pool.keep_empty(links.mode.get() == Mode::Text);
    if losing() {
        report_loss(links, told);
    }
    for _ in 0..TURN {
        if pool.ready() {
            let text = pool.put_text(received.waiting());
            received.release_many(text);
        }
        if !pool.ready() {
            return Left::Full;
        }
        let Some(byte) = received.pop() else {
            return Left::Nothing;
        };
        let damaged = byte == LOSS || byte == LOSS_AT_END;
        if damaged {
            pool.spoil(Status::BufferFull);
            report_loss(links, told);
            *told = false;
        }
        if byte != LOSS && pool.put(if damaged { b'\n' } else { byte }) {
            links.parser_wake.signal();
        }
    }
    Left::Bytes
}

/// Tells the sender that bytes are being lost, unless it has been `told` of this stretch of them.
fn report_loss(links: &Links, told: &mut bool) {
    if !core::mem::replace(told, true) {
        links.exception.set(Some(Status::BufferFull));
        links.reporter_wake.signal();
    }
}
