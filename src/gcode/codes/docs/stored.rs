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
            "Moves by rapids to the position that G28.1 has stored. `G28 X1` goes first to X1, then moves X to the stored \
position. `G28` alone moves all axes straight there. If G28.1 was never sent, the stored position is machine \
zero. An axis with a homing switch, and Z, must then be homed or set by G28.3, or be there already, else the line is \
refused with 248. X and Y without a switch go to where they were at the start, as in grbl. \
Once G28.1 was sent, no axis has to be homed, even after a power cut. The motion mode does not change.",
            &[no(NotHomed, &["G0 Z1", "G28 G91 Z0"])],
        ),
        g(
            281,
            "Store the first position",
            "Stores the present position, in machine coordinates, for G28.",
            &[no(AxisInvalid, &["G0", "G28.1 X1"])],
        ),
        g(
            300,
            "Go to the second stored position",
            "As G28, with the position of G30.1.",
            &[no(NotHomed, &["G30 X1"])],
        ),
        g(
            301,
            "Store the second position",
            "Stores the present position, in machine coordinates, for G30.",
            &[no(AxisInvalid, &["G0", "G30.1 X1"])],
        ),
        g(
            282,
            "Home",
            "Homes the named axes one by one, in the order Z X Y A. The numbers have no effect. An axis that stands on its switch first backs off by `lb`. It searches at `sv`, over its travel and `lb` at most, backs off at `lv` until the \
switch opens, and stops `zb` from there. This position is the end of its travel: `tn` at the lower switch, `tm` \
at the upper one, 0 if that is not set or if both are equal. Homing uses `jh`. The limit switches of the axis \
being homed are ignored. Afterwards give G0 or G1 again; other modes do not change. Later lines wait. Also \
refused, before anything moves: 242 if `sv` is 0, 243 if `lv` is 0, 244 if the search distance is 0, 246 if the \
axis does not have one homing switch. If the switch is not found or homing is flushed (240), or if a switch \
stays closed (247), the axis is not homed. In all these cases an exception names the axis (`ax`). `{home:1}` \
homes all axes that have a homing switch.",
            &[
                no(AxisWordMissing, &["G28.2"]),
                no_on(On::NoSwitches, HomingSwitches, &["G28.2 X0"]),
                no(HomingAxis, &["G28.2 B0"]),
                no_on(On::DisabledX, HomingAxis, &["G28.2 X0"]),
            ],
        ),
        g(
            284,
            "Home without setting the position",
            "As G28.2, but the position is not set, and no axis becomes homed.",
            &[
                no(AxisWordMissing, &["G28.4"]),
                no_on(On::NoSwitches, HomingSwitches, &["G28.4 X0"]),
                no(HomingAxis, &["G28.4 B0"]),
                no_on(On::DisabledX, HomingAxis, &["G28.4 X0"]),
            ],
        ),
        g(
            283,
            "Set machine position",
            "Sets the machine coordinates of the present position to the axis words, without a move. The named axes become \
homed: soft limits apply to them.",
            &[no(AxisWordMissing, &["G28.3"])],
        ),
    ],
};
