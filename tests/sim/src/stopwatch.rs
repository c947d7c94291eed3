//! Measures the CPU time of functions of the firmware, without the interrupts nested in them. Functions are found by
//! name.
//!
//! The image needs no preparation, but the function must not be inlined.

use crate::cpu::Cpu;
use crate::meters::Meters;

/// Cycles of something that has happened several times.
#[derive(Clone, Copy, Default, PartialEq, Eq, Debug)]
pub struct Cost {
    /// Number of occurrences.
    pub count: u64,
    /// Sum of all cycles.
    pub sum: u64,
    /// Most cycles of one occurrence.
    pub max: u64,
}

impl Cost {
    fn add(&mut self, cycles: u64) {
        self.count += 1;
        self.sum += cycles;
        self.max = self.max.max(cycles);
    }

    /// Mean cycles; 0 if it never happened.
    pub fn mean(&self) -> f64 {
        self.sum as f64 / self.count.max(1) as f64
    }
}

/// A call under way.
#[derive(Clone, Copy)]
struct Call {
    sp: u16,
    began: u64,
    in_interrupts: u64,
}

#[derive(Clone)]
enum Kind {
    /// Calls from thread code, from the first instruction to the end of the return.
    Calls { under_way: Option<Call> },
    /// Calls from an interrupt. `under_way` has the stack pointer, and the interrupt's own time when the call began.
    CallsIn { vector: u8, under_way: Option<(u16, u64)> },
    /// Laps of an interrupt: each call of the function ends one. What the interrupt does after its last call belongs
    /// to the last lap. The time of runs without a call is spread over all laps.
    Laps { vector: u8, lap: Lap },
}

/// The lap that has not ended.
#[derive(Clone, Copy, Default)]
struct Lap {
    /// The interrupt's own time when the previous lap ended.
    from: u64,
    /// The lap that ended last in this run of the interrupt. It is counted when it can no longer grow.
    ended: Option<u64>,
}

/// Measures one function or interrupt.
#[derive(Clone)]
pub struct Stopwatch {
    entry: u32,
    kind: Kind,
    cost: Cost,
}

impl Stopwatch {
    /// Times the calls of the function at `entry` from thread code.
    pub fn calls(entry: u32) -> Self {
        Stopwatch { entry, kind: Kind::Calls { under_way: None }, cost: Cost::default() }
    }

    /// Times the calls of the function at `entry` from an interrupt.
    pub fn calls_in(vector: u8, entry: u32) -> Self {
        Stopwatch { entry, kind: Kind::CallsIn { vector, under_way: None }, cost: Cost::default() }
    }

    /// Times an interrupt from one call of the function at `entry` to the next.
    pub fn laps(vector: u8, entry: u32) -> Self {
        let kind = Kind::Laps { vector, lap: Lap::default() };
        Stopwatch { entry, kind, cost: Cost::default() }
    }

    /// Returns the measurements.
    pub fn cost(&self) -> Cost {
        self.cost
    }

    /// Takes note that the instruction at `pc`, begun at `began`, was executed. `left` says that it ended an
    /// interrupt.
    #[inline]
    pub(crate) fn executed(
        &mut self,
        cpu: Cpu,
        pc: u32,
        began: u64,
        meters: &Meters,
        in_interrupts: u64,
        left: bool,
    ) {
        match &mut self.kind {
            Kind::Calls { under_way } if meters.depth() == 0 => match *under_way {
                None if pc == self.entry => {
                    // The stack pointer before the function has pushed anything.
                    let sp = cpu.sp() + u16::from(cpu.opcode(pc) & PUSH_MASK == PUSH);
                    *under_way = Some(Call { sp, began, in_interrupts });
                }
                // The stack pointer is read only at a RET. Elsewhere it may be half written.
                Some(call) if cpu.opcode(pc) == RET && cpu.sp() > call.sp => {
                    *under_way = None;
                    self.cost.add(cpu.cycle() - call.began - (in_interrupts - call.in_interrupts));
                }
                _ => {}
            },
            Kind::Calls { .. } => {}
            Kind::CallsIn { vector, under_way } => {
                let Some(own) = meters.serving(*vector, cpu.cycle()) else { return };
                match *under_way {
                    None if pc == self.entry => {
                        let sp = cpu.sp() + u16::from(cpu.opcode(pc) & PUSH_MASK == PUSH);
                        *under_way = Some((sp, own));
                    }
                    Some((sp, from)) if cpu.opcode(pc) == RET && cpu.sp() > sp => {
                        *under_way = None;
                        self.cost.add(own - from);
                    }
                    _ => {}
                }
            }
            Kind::Laps { vector, lap } => {
                let Some(own) = meters.serving(*vector, cpu.cycle()) else { return };
                if pc == self.entry {
                    lap.ended.replace(own - lap.from).into_iter().for_each(|c| self.cost.add(c));
                    lap.from = own;
                } else if left {
                    let rest = own - lap.from;
                    match lap.ended {
                        Some(cycles) => self.cost.add(cycles + rest),
                        None => self.cost.sum += rest,
                    }
                    *lap = Lap::default();
                }
            }
        }
    }
}

const RET: u16 = 0x9508;
/// The opcode of `push Rr` under this mask.
const PUSH: u16 = 0x920F;
const PUSH_MASK: u16 = 0xFE0F;
