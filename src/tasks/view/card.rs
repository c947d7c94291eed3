//! What senders ask of the SD card.

use kerf_macros::small;

use super::View;
use crate::card::{Op, is_in_use, prints, writes};
use crate::machine;
use crate::status::Status;

/// Does something with the card, unless a print or an upload is under way that this would disturb.
#[small]
#[inline(always)]
pub(super) fn card(view: &mut View<'_>, what: Op<'_>) -> Status {
    // Its lines come from this port's sender from now on.
    let feeds = matches!(what, Op::Print(true) | Op::Create(_));
    if feeds && !view.may_feed() {
        return Status::Muted;
    }
    let mut card = view.links.card.borrow_mut();
    let disturbs = !matches!(what, Op::Print(_) | Op::Seek(_) | Op::Finish | Op::Drop);
    if disturbs && is_in_use() {
        return Status::NotAccepted;
    }
    match what {
        Op::Begin => card.begin(),
        Op::Release => {
            card.release();
            Status::Ok
        }
        Op::Open(name) => card.open(name),
        Op::Delete(name) => card.delete(name),
        #[cfg(feature = "card-write")]
        Op::Create(name) => card.create(name),
        #[cfg(feature = "card-write")]
        Op::Finish => card.finish(),
        #[cfg(not(feature = "card-write"))]
        Op::Create(_) | Op::Finish => Status::NotBuiltIn,
        Op::Drop => {
            card.close();
            Status::Ok
        }
        Op::Print(_) | Op::Seek(_) if writes() => Status::NotAccepted,
        Op::Seek(at) => card.seek(at),
        Op::Print(true) if machine::is_alarmed() => machine::alarm().status(),
        Op::Print(prints) => {
            view.links.parser_wake.signal();
            card.print(prints)
        }
    }
}

/// Returns [`Value::FileUse`](crate::protocol::Value).
pub(super) fn file_use(view: &View<'_>) -> i32 {
    match view.links.card.borrow().progress() {
        None => 0,
        Some(_) if writes() => 3,
        Some(_) => 1 + i32::from(prints()),
    }
}

/// Returns how many bytes of the file have been read, and its length; 0 without a file. Both saturate.
pub(super) fn progress(view: &View<'_>) -> (i32, i32) {
    let int = |bytes| i32::try_from(bytes).unwrap_or(i32::MAX);
    let (at, of) = view.links.card.borrow().progress().unwrap_or((0, 0));
    (int(at), int(of))
}
