//! The settings of input shaping, for images that can shape.

use super::group;

group! {
    /// The group `is`.
    shaper: i32, PLAIN => {
        X "x": frequency(), 0,
            words(text!("x resonance"), HZ),
            "Frequency at which X rings, 20 to 100. The motion then leaves it out ([ringing.md](ringing.md)), and each stop takes a period longer. 0: X does not ring.";
        Y "y": frequency(), 0,
            words(text!("y resonance"), HZ),
            "Frequency at which Y rings. All axes move by the filters of all resonances; equal frequencies share one. The periods of different frequencies may take 100 ms together.";
        Z "z": frequency(), 0,
            words(text!("z resonance"), HZ),
            "Frequency at which Z rings.";
        T "t": whole(cold(0), 1).with(IDLE), 0,
            words(text!("shaper type"), SHAPERS),
            "How to shape. 0: a mean over a period. 1: EI, three impulses over a period, which also work if the resonance is up to 20 % off, and round corners more.";
        D "d": damping(), 100,
            words(text!("damping ratio"), NONE),
            "Damping ratio of the resonances, for type 1.";
    }
}
