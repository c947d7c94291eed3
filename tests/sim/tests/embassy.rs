//! The runtime, `avr-embassy`: its examples do what they say, and it costs what its README says.

mod common;

use std::path::PathBuf;

use kerf::boards::MEGA2560_GRBL;
use kerf_sim::Machine;

use common::{MS, firmware};

/// The vector of the tick.
const TIMER0_COMPA: u8 = 21;
const PORTB: u16 = 0x25;
/// An Arduino's pins.
const LED: u8 = 7;
const PIN_12: u8 = 6;
const PIN_11: u8 = 5;

/// A machine that runs an example.
fn example(name: &str) -> Machine {
    let folder = std::env::var_os("KERF_ELF_DIR")
        .map_or_else(|| PathBuf::from("../../target/firmware"), PathBuf::from);
    let elf = folder.join("avr-embassy").join(format!("{name}.elf"));
    assert!(elf.exists(), "no {}: `cargo xtask examples` makes it", elf.display());
    Machine::load(&elf, &MEGA2560_GRBL).unwrap()
}

/// The cycles at which each pin of port B turns over, up to a cycle.
fn edges(machine: &mut Machine, until: u64) -> [Vec<u64>; 8] {
    let mut edges: [Vec<u64>; 8] = Default::default();
    let mut before = machine.peek(PORTB);
    while machine.cycle() < until {
        machine.step(until).unwrap();
        let now = machine.peek(PORTB);
        for (pin, edges) in edges.iter_mut().enumerate() {
            if (before ^ now) >> pin & 1 != 0 {
                edges.push(machine.cycle());
            }
        }
        before = now;
    }
    edges
}

/// The shortest and the longest time between two edges, cycles.
fn intervals(edges: &[u64]) -> (u64, u64) {
    let gaps = || edges.windows(2).map(|pair| pair[1] - pair[0]);
    (gaps().min().unwrap_or(0), gaps().max().unwrap_or(0))
}

#[test]
fn two_tasks_blink_each_at_its_own_rate() {
    let mut machine = example("blink");
    let edges = edges(&mut machine, 1_002 * MS);
    for (pin, count, period) in [(LED, 8, 125 * MS), (PIN_12, 20, 50 * MS)] {
        let edges = &edges[usize::from(pin)];
        assert_eq!(edges.len(), count, "pin {pin}");
        let (least, most) = intervals(edges);
        // The other task may come first.
        assert!(least + 1_000 >= period && most <= period + 1_000, "{least} to {most}");
    }
}

#[test]
fn the_echo_sends_back_every_byte() {
    let text: Vec<u8> = (0..600u16).map(|n| n as u8).collect();
    let mut machine = example("echo");
    machine.run_for_ms(1).unwrap();
    machine.send(&text);
    machine.run_for_ms(60).unwrap();
    assert_eq!(machine.receive(), text);
    assert_eq!((machine.peek(PORTB) >> LED & 1, machine.uart(0).overruns()), (0, 0), "lost none");
}

#[test]
fn a_task_of_interrupt_mode_preempts_one_of_thread_mode() {
    let mut machine = example("preempt");
    let edges = edges(&mut machine, 450 * MS);
    let [pulse, work, tell] = [LED, PIN_12, PIN_11].map(|pin| &edges[usize::from(pin)]);
    // On time to some cycles, although the CPU is never idle and no poll of `work` is shorter than 20 ms.
    assert!(pulse.len() >= 448, "{} pulses", pulse.len());
    let (least, most) = intervals(pulse);
    assert!(least + 20 >= MS && most <= MS + 20, "{least} to {most} cycles");
    let (least, _) = intervals(work);
    assert!(work.len() >= 20 && least >= 20 * MS, "{} turns, {least}", work.len());
    // The signal from interrupt mode reaches thread mode between two polls of `work`: at the latest behind the next one.
    assert_eq!(tell.len(), 4);
    let late =
        tell.iter().zip(pulse.iter().skip(99).step_by(100)).map(|(tell, pulse)| tell - pulse);
    assert!(late.max() < Some(2 * 21 * MS), "later than two polls");
}

/// Every 256 ms the tick carries with interrupts on. A task of interrupt mode that asked for the time then would get one of 256 ms ago.
#[test]
fn interrupt_mode_is_kept_out_while_the_time_is_carried() {
    let mut machine = firmware(&MEGA2560_GRBL);
    let variable = |machine: &Machine, name| machine.image().variable(name).expect("a static");
    let millis = variable(&machine, "avr_embassy::time::MILLIS");
    let closed = variable(&machine, "avr_embassy::assembly::CLOSED");
    machine.run_for_ms(250).unwrap();
    assert_eq!((machine.peek(closed), machine.peek(millis + 1)), (0, 0), "at rest");
    let (mut low, mut kept_out) = (0, false);
    while machine.peek(millis + 1) == 0 {
        (low, kept_out) = (machine.peek(millis), machine.peek(closed) != 0);
        machine.step(u64::MAX).unwrap();
    }
    assert!(low == 0 && kept_out);
    machine.run_for_ms(1).unwrap();
    assert_eq!(machine.peek(closed), 0, "let in again");
}

#[test]
fn it_costs_what_the_readme_says() {
    let mut machine = example("costs");
    machine.run_for_ms(20).unwrap();
    let variable = |name: &str| machine.image().variable(name).expect("a static of the example");
    assert_eq!(machine.peek(variable("FINISHED")), 1);
    let costs = variable("COSTS");
    let mut rows: Vec<String> = WHAT
        .iter()
        .zip((costs..).step_by(2))
        .map(|(what, at)| format!("| {what} | {} |", machine.peek_word(at)))
        .collect();

    let mut ticking = example("blink");
    ticking.run_for_ms(600).unwrap();
    let tick = ticking.meters().service(TIMER0_COMPA);
    rows.push(format!("| the tick, each millisecond | {} |", tick.own_sum / tick.count));
    rows.push(format!("| the tick, every 256 ms | {} |", tick.own_max));
    let off = ticking.meters().window_outside().cycles;
    rows.push(format!("| interrupts off, at most | {off} |"));

    let readme = std::fs::read_to_string("../../avr-embassy/README.md").unwrap();
    let wrong: Vec<_> = rows.iter().filter(|row| !readme.contains(*row)).collect();
    assert!(wrong.is_empty(), "avr-embassy/README.md is to have these rows:\n{}", rows.join("\n"));
}

/// What `costs` measures, in its order.
const WHAT: [&str; 10] = [
    "`Event::set`",
    "`interrupt::lock`",
    "`Producer::push`, a byte",
    "`Consumer::pop`, a byte",
    "`time::millis`",
    "from `interrupt::pend` to the task of interrupt mode that waits",
    "from `interrupt::pend` to the next instruction of thread mode, behind that task",
    "from `Signal::signal` in thread mode to the task of interrupt mode",
    "from `Event::set` in a task to the task that waits for it, the rest of the poll included",
    "from an interrupt that sets an event to the task that waits, out of sleep",
];
