//! What a printing host asks of the SD card.

use kerf_macros::small;

use super::View;
use crate::card::{Op, prints};
use crate::machine;
use crate::status::Status;

/// Does something with the card, unless a print from it is under way that this would disturb.
#[small]
#[inline(always)]
pub(super) fn card(view: &mut View<'_>, what: Op<'_>) -> Status {
    let mut card = view.links.card.borrow_mut();
    let disturbs = matches!(what, Op::Begin | Op::Release | Op::Open(_) | Op::Delete(_));
    if disturbs && prints() {
        return Status::NotAccepted;
    }
    match what {
        Op::Begin => card.begin(),
        Op::Release => {
            card.release();
            Status::Ok
        }
        Op::Open(name) => card.open(name),
        Op::Seek(at) => card.seek(at),
        Op::Delete(name) => card.delete(name),
        Op::Print(true) if machine::is_alarmed() => machine::alarm().status(),
        Op::Print(prints) => {
            view.links.parser_wake.signal();
            card.print(prints)
        }
    }
}
