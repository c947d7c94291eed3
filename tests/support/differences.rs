//! Programs of `tests/nist` that Kerf treats differently on purpose: what differs, and why.

/// A text to be replaced, and its replacement. The text must occur exactly once.
type Edit = [&'static str; 2];

/// A program that Kerf treats differently.
pub struct Difference {
    pub name: &'static str,
    pub why: &'static str,
    /// Edits that turn the program into one that Kerf accepts.
    pub program: &'static [Edit],
    /// Edits that turn the expected motion into the motion that Kerf makes.
    pub motion: &'static [Edit],
}

/// All differences.
pub const DIFFERENCES: &[Difference] = &[
    Difference {
        name: "cycle_73",
        why: SLANT,
        program: &[],
        motion: &[[
            "TRAVERSE 20.0000 5.0000 10.0000 0.0000 0.0000 0.0000\nTRAVERSE 20",
            "TRAVERSE 20",
        ]],
    },
    Difference {
        name: "cycle_83",
        why: SLANT,
        program: &[],
        motion: &[[
            "TRAVERSE 20.0000 5.0000 10.0000 0.0000 0.0000 0.0000\nTRAVERSE 20",
            "TRAVERSE 20",
        ]],
    },
    Difference {
        name: "cycle_repeat",
        why: SLANT,
        program: &[],
        motion: &[[
            "TRAVERSE 15.0000 5.0000 3.0000 0.0000 0.0000 0.0000\nTRAVERSE 20.",
            "TRAVERSE 15.0000 5.0000 3.0000 0.0000 0.0000 0.0000\n\
             TRAVERSE 15.0000 5.0000 4.0000 0.0000 0.0000 0.0000\n\
             TRAVERSE 20.",
        ]],
    },
    Difference {
        name: "cycle_repeat_incremental",
        why: "RS274/NGC: with G91, R is counted from the present place, not from where the series \
              began",
        program: &[],
        motion: &[[
            "FEED 6.0000 2.0000 2.0000 0.0000 0.0000 0.0000\n\
             TRAVERSE 6.0000 2.0000 4.0000 0.0000 0.0000 0.0000\n",
            "TRAVERSE 6.0000 2.0000 3.0000 0.0000 0.0000 0.0000\n\
             FEED 6.0000 2.0000 1.0000 0.0000 0.0000 0.0000\n\
             TRAVERSE 6.0000 2.0000 3.0000 0.0000 0.0000 0.0000\n",
        ]],
    },
    Difference {
        name: "end_lines",
        why: "a sender's lines are a stream: those after the end of a program are those of the next",
        program: &[],
        motion: &[["END\n", "END\nTRAVERSE 2.0000 0.0000 0.0000 0.0000 0.0000 0.0000\n"]],
    },
    Difference {
        name: "end_percent",
        why: "a sender's lines are a stream: `%` ends nothing",
        program: &[],
        motion: &[[
            "TRAVERSE 2.0000 0.0000 0.0000 0.0000 0.0000 0.0000\n",
            "TRAVERSE 2.0000 0.0000 0.0000 0.0000 0.0000 0.0000\n\
             TRAVERSE 3.0000 0.0000 0.0000 0.0000 0.0000 0.0000\nEND\n",
        ]],
    },
    Difference {
        name: "tool_offset_axes",
        why: "tools have lengths along X and Z alone, for mills and lathes: memory (136)",
        program: &[["X1 Y2 Z3", "X1 Z3"]],
        motion: &[[
            "TRAVERSE 2.0000 3.0000 1.0000 0.0000 0.0000 0.0000\n\
             TRAVERSE 2.0000 3.0000 4.0000 0.0000 0.0000 0.0000\n\
             TRAVERSE 5.0000 3.0000 4.0000",
            "TRAVERSE 2.0000 1.0000 4.0000 0.0000 0.0000 0.0000\n\
             TRAVERSE 5.0000 1.0000 4.0000",
        ]],
    },
];

const SLANT: &str = "RS274/NGC: up to R at the old place, if it is below; across the plane; to R. \
                     Here the other interpreter goes over and up at once (`own_cycle_series`, \
                     `own_cycle_rise`)";

impl Difference {
    /// Returns the difference of a program; `None` if it has none.
    pub fn of(name: &str) -> Option<&'static Self> {
        DIFFERENCES.iter().find(|difference| difference.name == name)
    }
}

/// Returns a text with its edits.
pub fn edited(mut text: String, edits: &[Edit], why: &str) -> String {
    for [old, new] in edits {
        assert_eq!(text.matches(old).count(), 1, "{old:?} to {new:?}: {why}");
        text = text.replacen(old, new, 1);
    }
    text
}
