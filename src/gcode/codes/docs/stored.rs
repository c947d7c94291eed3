//! Places: stored positions, homing.

use super::{On, Section, g, no, no_on};
use crate::status::Status::{AxisInvalid, AxisWordMissing, HomingAxis, HomingSwitches};

pub const PLACES: Section = Section {
    title: "Stored positions and homing",
    intro: "",
    docs: &[
        g(
            280,
            "Go to the first stored position",
            "Traverses to the position of G28.1, at first 0 in machine coordinates. With axis words: by way of \
the words, and then the named axes only. Without: all axes, at once. The motion mode stays what it was.",
            &[],
        ),
        g(
            281,
            "Store the first position",
            "The present position, in machine coordinates, becomes that of G28.",
            &[no(AxisInvalid, &["G0", "G28.1 X1"])],
        ),
        g(300, "Go to the second stored position", "As G28, to the position of G30.1.", &[]),
        g(
            301,
            "Store the second position",
            "The present position, in machine coordinates, becomes that of G30.",
            &[no(AxisInvalid, &["G0", "G30.1 X1"])],
        ),
        g(
            282,
            "Home",
            "Homes the named axes, X Y Z or A, against their switches, and sets their positions; the numbers \
mean nothing. Refused on machines without switches.",
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
            "As G28.2, but positions stay what they were.",
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
