//! The runtime, `avr-embassy`: its examples do what they are documented to do, and its costs are those of its README.

use std::path::PathBuf;

use kerf::boards::MEGA2560_GRBL;
use kerf_sim::chip::{ATMEGA1284P, ATMEGA2560, Chip};
use kerf_sim::{Image, Machine};

use crate::common::{MS, firmware};

/// The vector of the tick.
const TICK: &str = "TIMER0_COMPA";
const PORTB: u16 = 0x25;
/// Bits of port B that an Arduino's pins are at.
const LED: u8 = 7;
const PIN_12: u8 = 6;
const PIN_11: u8 = 5;

/// Every chip for which the runtime has a file, and the folder of its examples.
const CHIPS: [(&Chip, &str); 2] = [(&ATMEGA2560, "atmega2560"), (&ATMEGA1284P, "atmega1284p")];

/// A chip at a clock rate that runs an example from a folder.
fn chip(chip: &'static Chip, clock_hz: u32, folder: &str, name: &str) -> Machine {
    let images = std::env::var_os("KERF_ELF_DIR")
        .map_or_else(|| PathBuf::from("../../../target/firmware"), PathBuf::from);
    let elf = images.join("avr-embassy").join(folder).join(format!("{name}.elf"));
    assert!(elf.exists(), "no {}: `cargo xtask examples` makes it", elf.display());
    Machine::bare(Image::read(&elf).unwrap(), chip, clock_hz).unwrap()
}

/// A chip at 20 MHz that runs `blink`.
fn uneven() -> Machine {
    chip(&ATMEGA1284P, 20_000_000, "atmega1284p-uneven-clock", "blink")
}

/// For each chip, at 16 MHz, a machine that runs an example.
fn example(name: &'static str) -> impl Iterator<Item = Machine> {
    CHIPS.into_iter().map(move |(of, folder)| chip(of, 16_000_000, folder, name))
}

/// Returns the cycles at which each pin of port B changes, up to a cycle.
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

/// Returns the shortest and the longest time between two edges, cycles.
fn intervals(edges: &[u64]) -> (u64, u64) {
    let gaps = || edges.windows(2).map(|pair| pair[1] - pair[0]);
    (gaps().min().unwrap_or(0), gaps().max().unwrap_or(0))
}

#[test]
fn two_tasks_blink_each_at_its_own_rate() {
    for mut machine in example("blink") {
        let edges = edges(&mut machine, 1_002 * MS);
        for (pin, count, period) in [(LED, 8, 125 * MS), (PIN_12, 20, 50 * MS)] {
            let edges = &edges[usize::from(pin)];
            assert_eq!(edges.len(), count, "pin {pin}");
            let (least, most) = intervals(edges);
            // The other task may come first.
            assert!(least + 1_000 >= period && most <= period + 1_000, "{least} to {most}");
        }
    }
}

/// A millisecond at 20 MHz is 78 and an eighth counts of 256 cycles. So milliseconds differ by at most one count, and
/// eight of them are exact.
#[test]
fn milliseconds_of_an_uneven_clock_are_exact_in_the_mean() {
    let mut machine = uneven();
    let millis = machine.image().variable("avr_embassy::time::MILLIS").expect("a static");
    let (mut ticks, mut before) = (Vec::new(), 0);
    while ticks.len() < 1_001 {
        machine.step(u64::MAX).unwrap();
        let now = machine.peek(millis);
        if now != before {
            assert_eq!(now, before.wrapping_add(1));
            ticks.push(machine.cycle());
        }
        before = now;
    }
    let cycles = |n: usize| ticks[n..].iter().zip(&ticks).map(move |(to, from)| to - from);
    // Exact to some cycles: a poll of a task may have interrupts off.
    let (least, most) = (cycles(1).min().unwrap(), cycles(1).max().unwrap());
    assert!(least + 40 >= 78 * 256 && most <= 79 * 256 + 40, "{least} to {most}");
    assert!(cycles(8).all(|cycles| cycles.abs_diff(8 * 20_000) < 40), "eight are 8 ms");
    assert!(cycles(1_000).all(|cycles| cycles.abs_diff(20_000_000) < 40), "a second");
    // Tasks see it in their times of 50 ms.
    let until = machine.cycle() + machine.cycles(1_001);
    let edges = &edges(&mut machine, until)[usize::from(PIN_12)];
    let (least, most) = intervals(edges);
    assert_eq!(edges.len(), 20);
    assert!(least + 1_500 >= 1_000_000 && most <= 1_001_500, "{least} to {most}");
}

#[test]
fn the_echo_sends_back_every_byte() {
    let text: Vec<u8> = (0..600u16).map(|n| n as u8).collect();
    for mut machine in example("echo") {
        machine.run_for_ms(1).unwrap();
        machine.send(&text);
        machine.run_for_ms(60).unwrap();
        assert_eq!(machine.receive(), text);
        let lost = (machine.peek(PORTB) >> LED & 1, machine.uart(0).overruns());
        assert_eq!(lost, (0, 0), "lost none");
    }
}

#[test]
fn a_task_of_interrupt_mode_preempts_one_of_thread_mode() {
    for mut machine in example("preempt") {
        let edges = edges(&mut machine, 450 * MS);
        let [pulse, work, tell] = [LED, PIN_12, PIN_11].map(|pin| &edges[usize::from(pin)]);
        // The pulses are on time to some cycles, although the CPU is never idle and no poll of `work` is shorter than
        // 20 ms.
        assert!(pulse.len() >= 448, "{} pulses", pulse.len());
        let (least, most) = intervals(pulse);
        assert!(least + 20 >= MS && most <= MS + 20, "{least} to {most} cycles");
        let (least, _) = intervals(work);
        assert!(work.len() >= 20 && least >= 20 * MS, "{} turns, {least}", work.len());
        // The signal from interrupt mode reaches thread mode between two polls of `work`, at the latest after the
        // next poll.
        assert_eq!(tell.len(), 4);
        let late =
            tell.iter().zip(pulse.iter().skip(99).step_by(100)).map(|(tell, pulse)| tell - pulse);
        assert!(late.max() < Some(2 * 21 * MS), "later than two polls");
    }
}

/// Every 256 ms the tick carries to the next byte with interrupts on. A task of interrupt mode that asked for the
/// time then would get a time of 256 ms ago.
#[test]
fn interrupt_mode_is_kept_out_while_the_time_is_carried() {
    let mut machine = firmware(&MEGA2560_GRBL);
    let variable = |machine: &Machine, name| machine.image().variable(name).expect("a static");
    let millis = variable(&machine, "avr_embassy::time::MILLIS");
    let closed = variable(&machine, "avr_embassy::assembly::CLOSED");
    machine.run_for_ms(250).unwrap();
    // The firmware may just hold a lock, for some hundred cycles.
    let soon = machine.cycle() + 1_000;
    while machine.peek(closed) != 0 && machine.cycle() < soon {
        machine.step(soon).unwrap();
    }
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
    let costs: Vec<_> = example("costs").map(costs).collect();
    let ticks: Vec<_> = example("blink").chain([uneven()]).map(tick).collect();
    let [large, small, uneven] = &ticks[..] else { panic!("{} machines", ticks.len()) };
    let each = WHAT.iter().enumerate().map(|(n, what)| (*what, costs[0][n], costs[1][n]));
    let rows = each.chain(TICKING.iter().enumerate().map(|(n, what)| (*what, large[n], small[n])));
    let mut rows: Vec<String> =
        rows.map(|(what, large, small)| format!("| {what} | {large} | {small} |")).collect();
    let [each, carrying, off] = uneven;
    rows.push(format!(
        "each tick takes {each} cycles, every 256 ms {carrying}, with interrupts off for {off}"
    ));

    let readme = std::fs::read_to_string("../../../avr-embassy/README.md").unwrap();
    let readme = readme.replace('\n', " ");
    let wrong: Vec<_> = rows.iter().filter(|row| !readme.contains(*row)).collect();
    assert!(wrong.is_empty(), "avr-embassy/README.md is to have these:\n{}", rows.join("\n"));
}

/// Returns what `costs` has measured.
fn costs(mut machine: Machine) -> Vec<u64> {
    machine.run_for_ms(20).unwrap();
    let variable = |name: &str| machine.image().variable(name).expect("a static of the example");
    assert_eq!(machine.peek(variable("FINISHED")), 1);
    (variable("COSTS")..)
        .step_by(2)
        .take(WHAT.len())
        .map(|at| machine.peek_word(at).into())
        .collect()
}

/// Returns what the tick costs while `blink` runs: see `TICKING`.
fn tick(mut machine: Machine) -> [u64; 3] {
    machine.run_for_ms(600).unwrap();
    let tick = machine.meters().service(machine.chip().vector(TICK));
    let off = machine.meters().window_outside().cycles;
    [tick.own_sum / tick.count, tick.own_max, off]
}

const TICKING: [&str; 3] =
    ["the tick, each millisecond", "the tick, every 256 ms", "interrupts off, at most"];

/// The names of what `costs` measures, in its order.
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
