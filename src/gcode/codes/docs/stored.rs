//! Places: stored positions, homing.

use super::{On, Section, g, no, no_on};
use crate::status::Status::{AxisInvalid, AxisWordMissing, HomingAxis, HomingSwitches, NotHomed};

pub const PLACES: Section = Section {
    title: "Stored positions and homing",
    intro: "",
    docs: &[
        g(
            280,
            "Go to the first stored position",
            "Traverses to the position of G28.1. `G28 X1` goes first to X1, then moves X to the stored position. `G28` alone moves all \
axes straight there. Before G28.1 was ever sent the position is 0 in machine coordinates. Each of X, Y and Z that G28 moves then has to be homed, or set by G28.3: \
else the line is refused with 248. Once G28.1 was sent nothing has to be homed, not after a power cut either. The motion mode stays what it was.",
            &[no(NotHomed, &["G28 G91 Z0"])],
        ),
        g(
            281,
            "Store the first position",
            "The present position, in machine coordinates, becomes that of G28.",
            &[no(AxisInvalid, &["G0", "G28.1 X1"])],
        ),
        g(
            300,
            "Go to the second stored position",
            "As G28, to the position of G30.1.",
            &[no(NotHomed, &["G30 X0"])],
        ),
        g(
            301,
            "Store the second position",
            "The present position, in machine coordinates, becomes that of G30.",
            &[no(AxisInvalid, &["G0", "G30.1 X1"])],
        ),
        g(
            282,
            "Home",
            "Homes the named axes, one by one in the order Z X Y A; the numbers mean nothing. An axis that stands on its \
switch backs off it by `lb`; it then searches at `sv`, for its whole travel and `lb` at most, backs off at `lv` until the \
switch opens, and stops `zb` from there. It is then at the end of its travel: `tn` at the lower switch, `tm` at the upper; 0 if \
that is not set or both are the same. It uses `jh`; the limit switches of the axis being homed are ignored. Afterwards give G0 or G1 again; other \
modes stay. Later lines wait. Also refused, before anything moves, with 242 if `sv` is 0, 243 if `lv` is, 244 if there is no way \
to search; 246: there must be one homing switch. An exception names the axis (`ax`), as it does if the switch is not found \
or the homing is flushed (240), or if a switch stays closed (247): then the axis is not homed. `{home:1}` homes all axes that have a \
switch for it.",
            &[
                no(AxisWordMissing, &["G28.2"]),
                no_on(On::NoSwitches, HomingSwitches, &["G28.2 X0"]),
                no(HomingAxis, &["G28.2 B0"]),
                no_on(On::DisabledX, HomingAxis, &["G28.2 X0"]),
            ],
        ),
        g(
            284,
            "Home, position kept",
            "As G28.2, but positions count on, and no axis becomes homed by it.",
            &[
                no(AxisWordMissing, &["G28.4"]),
                no_on(On::NoSwitches, HomingSwitches, &["G28.4 X0"]),
                no(HomingAxis, &["G28.4 B0"]),
                no_on(On::DisabledX, HomingAxis, &["G28.4 X0"]),
            ],
        ),
        g(
            283,
            "Set the position",
            "The present position is called the axis words, in machine coordinates, without a move. The named \
axes count as homed: soft limits are for those.",
            &[no(AxisWordMissing, &["G28.3"])],
        ),
    ],
};
