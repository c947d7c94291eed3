//! Small programs whose stack use is known.

use super::*;

/// Returns code with one instruction every two bytes from address 0.
fn code(lines: &[&str]) -> Code {
    let rows = lines.iter().enumerate().map(|(i, l)| format!(" {:x}:\t{l}\n", 2 * i));
    Code::parse(&rows.collect::<String>())
}

fn frame(lines: &[&str]) -> u32 {
    follow(&code(lines), 0, &Landmarks::default()).frame
}

#[test]
fn pushes_count_on_the_deepest_branch() {
    let early = ["push\tr2", "breq\t.+2\t; 0x8", "pop\tr2", "ret", "push\tr3", "push\tr4"];
    assert_eq!(frame(&early), 3);
}

#[test]
fn frames_by_the_frame_pointer_count() {
    let small = ["push\tr28", "push\tr29", "in\tr28, 0x3d", "in\tr29, 0x3e"];
    let reserve = ["sbiw\tr28, 0x05", "in\tr0, 0x3f", "cli", "out\t0x3e, r29"];
    let rest = ["out\t0x3f, r0", "out\t0x3d, r28", "push\tr2", "ret"];
    assert_eq!(frame(&[&small[..], &reserve, &rest].concat()), 8);

    let large = ["subi\tr28, 0x2C", "sbci\tr29, 0x01", "cli", "out\t0x3e, r29"];
    assert_eq!(frame(&[&small[..], &large, &rest].concat()), 303);
}

#[test]
fn room_for_arguments_is_given_back() {
    let take = ["in\tr30, 0x3d", "sbiw\tr30, 0x06", "out\t0x3d, r30", "call\t0x100\t; 0x100"];
    let give = ["in\tr30, 0x3d", "subi\tr30, 0xFA", "sbci\tr31, 0xFF", "out\t0x3d, r30"];
    let flow =
        follow(&code(&[&take[..], &give, &["push\tr2", "ret"]].concat()), 0, &Landmarks::default());
    assert_eq!(flow.frame, 6);
    assert_eq!(flow.calls, BTreeMap::from([(0x100, 9)]));
}

#[test]
fn calls_are_edges_and_jumps_are_followed() {
    let lines = ["push\tr2", "rcall\t.+4\t; 0xa", "pop\tr2", "rjmp\t.+2\t; 0xa", "nop"];
    let flow = follow(&code(&[&lines[..], &["sei", "eicall", "ret"]].concat()), 0, &{
        Landmarks::default()
    });
    assert_eq!(flow.calls, BTreeMap::from([(0xa, 4)]));
    assert_eq!(flow.indirect, Some(3));
    assert!(flow.enables_interrupts);
}

#[test]
fn a_call_at_the_end_of_a_function_does_not_return() {
    let marks = Landmarks { ends: HashSet::from([4]), ..Default::default() };
    let flow = follow(&code(&["nop", "call\t0x100\t; 0x100", "push\tr2"]), 0, &marks);
    assert_eq!(flow.frame, 0);
}

#[test]
fn a_shared_prologue_comes_back() {
    let marks = Landmarks { prologue_saves: 6..12, ..Default::default() };
    let lines = ["rjmp\t.+6\t; 0x8", "push\tr9", "ret", "push\tr2", "push\tr3", "eijmp"];
    assert_eq!(follow(&code(&lines), 0, &marks).frame, 2);
}

#[test]
fn a_prologue_that_is_called_leaves_more_on_the_stack() {
    let marks = Landmarks { enters: HashSet::from([8]), ..Default::default() };
    let calls = ["ldi\tr26, 0x05", "rcall\t.+4\t; 0x8", "push\tr2", "ret"];
    let takes = [
        "pop\tr0",
        "pop\tr31",
        "pop\tr30",
        "push\tr28",
        "push\tr29",
        "in\tr26, 0x3f",
        "out\t0x3e, r29",
    ];
    let rest =
        ["out\t0x3d, r28", "rjmp\t.+2\t; 0x1c", "nop", "push\tr30", "push\tr31", "push\tr0", "ret"];
    let flow = follow(&code(&[&calls[..], &takes, &rest].concat()), 0, &marks);
    // Two registers, a frame of five and the return address. After that it gets no deeper.
    assert_eq!(flow.frame, 2 + 5 + 3);
    assert!(flow.calls.is_empty());
    let two = ["ldi\tr26, 0x2c", "ldi\tr27, 0x01", "rcall\t.+2\t; 0x8", "ret"];
    assert_eq!(follow(&code(&[&two[..], &takes, &rest].concat()), 0, &marks).frame, 2 + 300 + 3);
}

#[test]
fn a_loop_that_pushes_is_noticed() {
    let flow = follow(&code(&["push\tr2", "rjmp\t.-4\t; 0x0"]), 0, &Landmarks::default());
    assert!(flow.bottomless);
}
