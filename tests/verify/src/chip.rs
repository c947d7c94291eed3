//! The checks of the chip, by the self-test image `tests/chip/verify.rs`, which has the protocol.
//!
//! | check | how |
//! |---|---|
//! | memory | a march test of all RAM that the image does not use itself |
//! | supply | the chip compares its supply with its own reference voltage, which is good to 10 % |
//! | clock, timers | each of the six timers counts between two bytes, whose times the computer knows |
//! | rates | random bytes at each rate, which the chip sends back; it counts framing errors and overruns |
//! | EEPROM | each cell takes the complement of its content, and its content again |
//! | duty cycle | the pin of the spindle's pulses is high for a quarter, a half, three quarters of the time; the converter measures it through a jumper |
//! | watchdog | the chip hangs, and must come back |
//! | free stack | RAM is painted, Kerf runs in it, the paint that is left is counted |

use std::time::Duration;

use crate::Plan;
use crate::board::{Board, Image};
use crate::line::Line;
use crate::random::Random;
use crate::report::{Checked, Report, judged};

/// What the image says after a reset.
const GREETING: &str = "kerf-chip 1 ";
/// Why the chip is not tested.
const NOT_FLASHED: &str = "the self-test image was not flashed";
/// Longest time from a reset to it. The boot loader waits for a second; early bytes make it wait for five more.
const START: Duration = Duration::from_secs(8);
/// Longest time of an answer that needs no time of its own.
const ANSWER: Duration = Duration::from_secs(3);
/// Longest time of a test of the RAM.
const RAM: Duration = Duration::from_secs(20);
/// Least RAM that is tested: the chip has 8,192 bytes.
const LEAST_RAM: u32 = 7_000;
const MOST_RAM: u32 = 8_192;
/// The limits of the supply of a chip at 16 MHz, mV, each with the 10 % that the reference may be off.
const SUPPLY: (u32, u32) = (4_100, 6_000);
/// Greatest deviation of the clock. A resonator is good to 0.5 %, and a serial line fails from about 2 % on.
const CLOCK_PPM: f64 = 10_000.0;
/// Greatest difference between the counts of two timers: they start and stop one after the other.
const APART: u32 = 20;
/// Clocks in a count.
const PRESCALE: f64 = 64.0;
/// The rates that Kerf offers.
const RATES: [u32; 6] = [9_600, 57_600, 115_200, 230_400, 250_000, 500_000];
/// Number of bytes at each rate.
const BYTES: usize = 1_024;
/// Number of bytes that are on their way at a time, both ways together: the USB chip of a Mega has little memory.
const WINDOW: usize = 32;
/// Longest wait for bytes that come back, ms. Shorter than the silence that ends the test, which is 300 ms.
const ECHO: Duration = Duration::from_millis(200);
/// Longest time until a board that was at another rate is back at the usual one.
const BACK: Duration = Duration::from_secs(5);
/// Shortest time from a hang to the reset by the watchdog, whose time is 250 ms, to 20 %.
const BITES: Duration = Duration::from_millis(200);
/// The reading of the converter at the voltage of the supply.
const FULL_SCALE: u32 = 1_023;
/// Greatest deviation of a duty cycle. The number of pulses that are measured is no whole one: 1 %.
const DUTY_ERROR: f64 = 0.03;
/// Number of EEPROM cells, and of those in one request.
const CELLS: u32 = 4_096;
const CELLS_AT_ONCE: u32 = 64;

#[derive(Clone, Copy)]
enum Check {
    Ram,
    Supply,
    Clock,
    Timers,
    Rates,
    Cells,
    Duty,
    Watchdog,
}

impl Check {
    const ALL: [Check; 8] = [
        Check::Ram,
        Check::Supply,
        Check::Clock,
        Check::Timers,
        Check::Rates,
        Check::Cells,
        Check::Duty,
        Check::Watchdog,
    ];

    fn name(self) -> &'static str {
        match self {
            Check::Ram => "RAM",
            Check::Supply => "supply",
            Check::Clock => "clock of the chip",
            Check::Timers => "timers",
            Check::Rates => "rates of the line",
            Check::Cells => "EEPROM",
            Check::Duty => "duty cycle",
            Check::Watchdog => "watchdog",
        }
    }

    fn wanted(self) -> &'static str {
        match self {
            Check::Ram => "each byte keeps what is written",
            Check::Supply => "4.5 to 5.5 V, measured to 10 %",
            Check::Clock => "within 1 %; a resonator has 0.5 %, a crystal 100 ppm",
            Check::Timers => "all count alike",
            Check::Rates => "each random byte comes back",
            Check::Cells => "each cell takes both values of each bit",
            Check::Duty => "a quarter, a half, three quarters, to 3 %",
            Check::Watchdog => "a chip that hangs starts anew",
        }
    }

    /// Why the check cannot be made.
    fn hindrance(self, plan: &Plan) -> Option<&'static str> {
        let lacks = matches!(self, Check::Duty) && plan.jumpers.is_none();
        lacks.then_some("there is no jumper")
    }

    async fn run(self, line: &mut Line<'_, impl Board>, plan: &Plan) -> Checked {
        match self {
            Check::Ram => ram(line).await,
            Check::Supply => supply(line).await,
            Check::Clock => clock(line, plan).await,
            Check::Timers => timers(line, plan).await,
            Check::Rates => rates(line, plan).await,
            Check::Cells => cells(line).await,
            Check::Duty => duty(line, plan).await,
            Check::Watchdog => watchdog(line).await,
        }
    }
}

/// Makes all checks. Returns whether the RAM has been painted.
pub async fn check(
    line: &mut Line<'_, impl Board>,
    plan: &Plan,
    report: &mut Report,
) -> Result<(), String> {
    let mut start = begin(line).await;
    let wanted = "is flashed, and says its name";
    report.add_and_tell(line.board(), "self-test image", wanted, named(&start));
    for one in Check::ALL {
        let hindrance = start.as_ref().err().map(String::as_str).or(one.hindrance(plan));
        if let Some(why) = hindrance {
            report.leave_out(one.name(), one.wanted(), why);
            continue;
        }
        line.board().tell(one.name());
        let result = one.run(line, plan).await;
        let again = result.is_err();
        report.add_and_tell(line.board(), one.name(), one.wanted(), result);
        if again {
            start = restart(line).await;
        }
    }
    start?;
    let [painted] = numbers(line, "paint", ANSWER).await?;
    if painted < LEAST_RAM { Err(format!("only {painted} bytes are painted")) } else { Ok(()) }
}

/// Says that none of the checks was made. Returns why.
pub fn leave_out(report: &mut Report) -> Result<(), String> {
    for one in Check::ALL {
        report.leave_out(one.name(), one.wanted(), NOT_FLASHED);
    }
    Err(NOT_FLASHED.into())
}

fn named(start: &Result<String, String>) -> Checked {
    match start {
        Ok(name) => judged(true, name.clone()),
        Err(why) => Err(why.clone()),
    }
}

async fn begin(line: &mut Line<'_, impl Board>) -> Result<String, String> {
    line.flash(Image::SelfTest).await?;
    greeting(line).await
}

async fn restart(line: &mut Line<'_, impl Board>) -> Result<String, String> {
    line.board().set_rate(115_200).await?;
    line.reset().await?;
    greeting(line).await
}

/// Waits for the image's name.
async fn greeting(line: &mut Line<'_, impl Board>) -> Result<String, String> {
    let lines = line.until(START, |line| line.contains(GREETING)).await?;
    Ok(lines.last().cloned().unwrap_or_default())
}

/// Sends a command, and returns the numbers of its answer, which begins with the same word.
async fn numbers<const N: usize>(
    line: &mut Line<'_, impl Board>,
    command: &str,
    longest: Duration,
) -> Result<[u32; N], String> {
    line.forget().await?;
    line.say(command).await?;
    answer(line, command.split(' ').next().unwrap_or(command), longest).await
}

/// Waits for an answer that begins with `word`, and returns its numbers.
async fn answer<const N: usize>(
    line: &mut Line<'_, impl Board>,
    word: &str,
    longest: Duration,
) -> Result<[u32; N], String> {
    let lines = line.until(longest, |_| true).await?;
    let said = lines.first().map(String::as_str).unwrap_or_default();
    let rest = said.strip_prefix(word);
    let found: Option<Vec<u32>> =
        rest.and_then(|rest| rest.split_whitespace().map(|number| number.parse().ok()).collect());
    let found = found.and_then(|numbers| numbers.try_into().ok());
    found.ok_or_else(|| format!("instead of `{word}` the board says {said:?}"))
}

async fn ram(line: &mut Line<'_, impl Board>) -> Checked {
    let [tested, bad, first] = numbers(line, "ram", RAM).await?;
    let measured = match bad {
        0 => format!("{tested} bytes"),
        _ => format!("{bad} of {tested} bytes are bad, the first at {first:#x}"),
    };
    judged(bad == 0 && (LEAST_RAM..=MOST_RAM).contains(&tested), measured)
}

async fn supply(line: &mut Line<'_, impl Board>) -> Checked {
    let [reading] = numbers(line, "volt", ANSWER).await?;
    let millivolts = (1_100 * 1_024u32).checked_div(reading).unwrap_or(u32::MAX);
    let measured = format!("{:.2} V", f64::from(millivolts) / 1_000.0);
    judged((SUPPLY.0..=SUPPLY.1).contains(&millivolts), measured)
}

/// Lets all timers count for `seconds`. Returns their counts, and the time in seconds.
async fn count(line: &mut Line<'_, impl Board>, seconds: u32) -> Result<([u32; 6], f64), String> {
    line.say("count").await?;
    let start = line.now();
    line.pass(Duration::from_secs(seconds.into())).await?;
    line.say("").await?;
    let time = line.now() - start;
    Ok((answer(line, "count", ANSWER).await?, time.as_secs_f64()))
}

async fn clock(line: &mut Line<'_, impl Board>, plan: &Plan) -> Checked {
    let (counts, time) = count(line, plan.seconds).await?;
    let hertz = f64::from(counts[1]) * PRESCALE / time;
    let nominal = f64::from(plan.clock_hz.unwrap_or(1));
    let ppm = (hertz / nominal - 1.0) * 1e6;
    judged(ppm.abs() <= CLOCK_PPM, format!("{ppm:+.0} ppm against this computer's clock"))
}

async fn timers(line: &mut Line<'_, impl Board>, plan: &Plan) -> Checked {
    let (counts, _) = count(line, plan.seconds.min(2)).await?;
    let usual = counts[1];
    let is_like = |counts: &u32| counts.abs_diff(usual) <= APART;
    let bad: Vec<String> = (0..)
        .zip(&counts)
        .filter(|(_, counts)| !is_like(counts))
        .map(|(n, counts)| format!("timer {n} counts {counts}"))
        .collect();
    let measured = match bad.is_empty() && usual > 0 {
        true => format!("six timers, {usual} counts each"),
        false => format!("timer 1 counts {usual}; {}", bad.join("; ")),
    };
    judged(bad.is_empty() && usual > 0, measured)
}

async fn rates(line: &mut Line<'_, impl Board>, plan: &Plan) -> Checked {
    let mut random = Random::new(plan.seed);
    let mut bad = Vec::new();
    for rate in RATES {
        if let Err(why) = echoed(line, rate, &random.bytes(BYTES)).await? {
            bad.push(format!("{rate} baud: {why}"));
        }
    }
    let measured = match bad.is_empty() {
        true => format!("{BYTES} bytes at each of {RATES:?} baud"),
        false => bad.join("; "),
    };
    judged(bad.is_empty(), measured)
}

/// Sends bytes at a rate, and compares what comes back. The inner error says what is wrong with the rate, the outer
/// one that the board does not come back from it.
async fn echoed(
    line: &mut Line<'_, impl Board>,
    rate: u32,
    bytes: &[u8],
) -> Result<Result<(), String>, String> {
    let [_divisor] = numbers(line, &format!("rate {rate} {}", bytes.len()), ANSWER).await?;
    line.board().set_rate(rate).await?;
    let (mut wrong, mut lost) = (0, 0);
    for chunk in bytes.chunks(WINDOW) {
        let back = exchange(line, chunk).await?;
        wrong += back.iter().zip(chunk).filter(|(back, sent)| back != sent).count();
        wrong += back.len().saturating_sub(chunk.len());
        lost += chunk.len().saturating_sub(back.len());
        // What is not even in step any more says nothing further.
        if lost > WINDOW {
            break;
        }
    }
    line.board().set_rate(115_200).await?;
    let said = line.until(BACK, |line| line.starts_with("echo ")).await?;
    let said = said.last().map(String::as_str).unwrap_or_default();
    let counted = format!("echo {} 0 0", bytes.len());
    Ok(match (wrong, lost, said == counted) {
        (0, 0, true) => Ok(()),
        _ => Err(format!(
            "{wrong} bytes came back wrong, {lost} or more not at all; the chip: {said}"
        )),
    })
}

/// Sends some bytes, and returns those that come back.
async fn exchange(line: &mut Line<'_, impl Board>, bytes: &[u8]) -> Result<Vec<u8>, String> {
    line.board().send(bytes).await?;
    let mut back = Vec::new();
    while back.len() < bytes.len() {
        let until = line.now() + ECHO;
        let more = line.board().receive(until).await?;
        if more.is_empty() {
            break;
        }
        back.extend(more);
    }
    Ok(back)
}

async fn cells(line: &mut Line<'_, impl Board>) -> Checked {
    let (mut bad, mut first) = (0, None);
    for from in (0..CELLS).step_by(CELLS_AT_ONCE as usize) {
        let command = format!("cells {from} {CELLS_AT_ONCE}");
        let [at_once, count, some, at] = numbers(line, &command, ANSWER).await?;
        if at_once != from || count != CELLS_AT_ONCE || some > count {
            return Err(format!("the answer to {command:?} is about {count} cells from {at_once}"));
        }
        bad += some;
        first = first.or((some > 0).then_some(at));
    }
    let measured = match first {
        None => format!("{CELLS} cells"),
        Some(at) => format!("{bad} of {CELLS} cells are bad, the first at {at:#x}"),
    };
    judged(bad == 0, measured)
}

async fn duty(line: &mut Line<'_, impl Board>, plan: &Plan) -> Checked {
    let channel = plan.jumpers.map_or(0, |jumpers| jumpers.pwm);
    let readings: [u32; 3] = numbers(line, &format!("duty {channel}"), ANSWER).await?;
    let shares = readings.map(|reading| f64::from(reading) / f64::from(FULL_SCALE));
    let is_near = |(share, wanted): (&f64, f64)| (share - wanted).abs() <= DUTY_ERROR;
    let sound = shares.iter().zip([0.25, 0.5, 0.75]).all(is_near);
    let measured = shares.map(|share| format!("{:.1} %", 100.0 * share)).join(", ");
    judged(sound, measured)
}

async fn watchdog(line: &mut Line<'_, impl Board>) -> Checked {
    let [] = numbers(line, "hang", ANSWER).await?;
    let start = line.now();
    greeting(line).await.map_err(|why| format!("the chip does not come back: {why}"))?;
    let time = line.now() - start;
    judged(time >= BITES, format!("back after {:.2} s", time.as_secs_f64()))
}

/// Bytes behind the static data of Kerf that have the mark of the last reset.
const MARK: u16 = 2;
/// The least stack that must be left.
const LEAST_STACK: u32 = 100;

/// Counts the paint behind the static data of Kerf, which has run since the RAM was painted. Kerf is on the board
/// again afterwards.
pub async fn free_stack(
    line: &mut Line<'_, impl Board>,
    plan: &Plan,
    painted: &Result<(), String>,
    report: &mut Report,
) {
    let (name, wanted) = ("free stack", "100 bytes or more never used");
    let from = match (plan.static_end, painted) {
        (Some(from), Ok(())) => from,
        (_, Err(why)) => return report.leave_out(name, wanted, why),
        (None, _) => return report.leave_out(name, wanted, "the image is not known"),
    };
    let result = stack_left(line, from).await;
    report.add_and_tell(line.board(), name, wanted, result);
    if let Err(why) = line.flash(Image::Kerf).await {
        report.add("Kerf, flashed again", "is on the board at the end", Err(why));
    }
}

async fn stack_left(line: &mut Line<'_, impl Board>, from: u16) -> Checked {
    begin(line).await?;
    let command = format!("stack {}", from.saturating_add(MARK));
    let [left] = numbers(line, &command, ANSWER).await?;
    judged((LEAST_STACK..=MOST_RAM).contains(&left), format!("{left} bytes"))
}
