//! The stopwatches, tested on a few instructions with known cycles.

use kerf_sim::Stopwatch;

use crate::common::machine_of;

const NOP: u16 = 0x0000;
const RET: u16 = 0x9508;
const PUSH_R0: u16 = 0x920F;
const POP_R0: u16 = 0x900F;
/// `rcall` and `rjmp` with distances in words.
const RCALL_BACK_8: u16 = 0xDFF8;
const RJMP_BACK_2: u16 = 0xCFFE;
const RJMP_ON_6: u16 = 0xC006;

#[test]
fn a_call_takes_from_its_first_instruction_to_its_return() {
    // Calls the function at word 1 again and again: push, nop, pop, ret take 2 + 1 + 2 + 5.
    let program = [RJMP_ON_6, PUSH_R0, NOP, POP_R0, RET, NOP, NOP, NOP, RCALL_BACK_8, RJMP_BACK_2];
    let mut machine = machine_of(&program);
    machine.add_stopwatch(Stopwatch::calls(2));
    machine.run_until(10_000).unwrap();
    let cost = machine.stopwatches()[0].cost();
    assert!(cost.count > 500, "{cost:?}");
    assert_eq!((cost.max, cost.sum), (10, 10 * cost.count));
    assert_eq!(cost.mean(), 10.0);
}
