//! Motors that make more steps than a block holds within the length up to which lines are merged.

use kerf::hal::imp::Machine;

/// Returns the end position and the highest position of motor 1, which has 12,800 steps a mm.
fn driven(last: &str) -> (i64, i64) {
    let machine = Machine::boot(115_200).expect("one machine for each thread");
    machine.run_ms(100);
    for line in ["{sv:0}\n", "{1tr:1}\n", "{1mi:64}\n"] {
        machine.send(line.as_bytes());
        machine.run_ms(400);
    }
    for line in ["g1 y2 f100\n", "y3 f200\n", "x1 f16000\n", "x2\n", "x3\n", last] {
        machine.send(line.as_bytes());
    }
    let mut most = 0;
    for _ in 0..20_000 {
        machine.run_ms(1);
        most = most.max(machine.emitted().position[0]);
    }
    (machine.emitted().position[0], most)
}

#[test]
fn lines_that_lie_on_a_line_are_driven_to_their_end() {
    assert_eq!(driven(""), (3 * 12_800, 3 * 12_800));
}

#[test]
fn the_way_out_is_driven_before_the_way_back() {
    let (end, most) = driven("x0\n");
    assert_eq!(end, 0);
    // The means round the turn by 18 um at 500 mm/s^2.
    assert!((3 * 12_800 - 240..=3 * 12_800).contains(&most), "{most}");
}
