//! The way of an arc on the image, not only its end: how far each motor goes in all.

mod common;

use common::{booted, set};
use kerf::boards::MEGA2560_GRBL;

/// Steps in a millimetre.
const MM: u64 = 1280;

/// Arcs of 2 mm radius around (0, 0) that begin at (2, 0) of the plane: the words with `@` for the first
/// axis and `#` for the second, and the way of both axes, mm.
const ARCS: [(&str, u64, u64); 6] = [
    ("g3 @0 #2", 2, 2),
    ("g2 @0 #2", 6, 6),
    ("g3 @-2 #0", 4, 4),
    ("g2 @-2 #0", 4, 4),
    ("g3 @0 #-2", 6, 6),
    ("g2 @0 #-2", 2, 2),
];

#[test]
fn every_arc_goes_its_way_round() {
    let (mut machine, mut host) = booted(&MEGA2560_GRBL);
    for line in ["{xjm:5000,yjm:5000,zjm:5000}", "g1 f800"] {
        set(&mut machine, &mut host, line);
    }
    // Axes 0 to 2 of each plane, and the letter of the offset.
    for (plane, first, second, offset) in
        [("g17", 0, 1, 'i'), ("g18", 2, 0, 'k'), ("g19", 1, 2, 'j')]
    {
        let letter = |axis: usize| ["x", "y", "z"][axis];
        for (words, first_mm, second_mm) in ARCS {
            set(&mut machine, &mut host, &format!("g28.3 {}2 {}0", letter(first), letter(second)));
            machine.run_for_ms(50).unwrap();
            let steps = |machine: &kerf_sim::Machine| {
                [first, second].map(|axis| machine.recorder().motors()[axis].steps)
            };
            let before = steps(&machine);
            let words = words.replace('@', letter(first)).replace('#', letter(second));
            set(&mut machine, &mut host, &format!("{plane} {words} {offset}-2"));
            machine.run_for_ms(3_000).unwrap();
            let after = steps(&machine);
            let went = [after[0] - before[0], after[1] - before[1]];
            let wanted = [first_mm * MM, second_mm * MM];
            // Chords cut the turning points off by 10 um at most, on the way there and back.
            let near =
                |(went, wanted): (&u64, &u64)| wanted - wanted / 50 <= *went && went <= wanted;
            assert!(went.iter().zip(&wanted).all(near), "{plane} {words}: {went:?} not {wanted:?}");
        }
    }
}
