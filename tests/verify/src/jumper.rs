//! The checks with jumpers: from the step pin of X to a counter of the chip, and from its direction pin to the input of
//! its lower switch.
//!
//! The counter counts in hardware what comes out of the step pin. The pulses must be as many as the steps that Kerf
//! reports.
//!
//! For the switch, Y moves at full speed. A line begins in which X turns, so its direction pin closes the switch at a
//! known step of Y. The switch is a limit, and stops Y. The steps that Y makes after that are the time from the switch
//! to the last step. A step pin could not do this: inputs ignore what is as short as its pulse.

use std::time::Duration;

use crate::Plan;
use crate::board::Board;
use crate::dialect::TINYG;
use crate::dialect::tinyg::SWITCHES;
use crate::firmware::Kerf;
use crate::line::Line;
use crate::report::{Checked, Report, and_restored, judged};

const NAME: &str = "switch to last step";
const WANTED: &str = "70 us, and the step that was under way";
/// The longest time, s (docs/safety.md, A1).
const LONGEST: f64 = 70e-6;
/// Length of each of the two lines, mm, and their speed, mm/min. `careful` reaches it.
const LENGTH: f64 = 4.0;
const SPEED: f64 = 800.0;
/// Makes the lower switch of X a limit that closes to ground, and all other inputs no switches.
const LIMIT: &str = "{xsn:2,st:0}";
/// No input is a switch.
const NO_SWITCH: &str = "{xsn:0,xsx:0,ysn:0,ysx:0,zsn:0,zsx:0}";
/// The motors have no power.
const NO_POWER: &str = "{1pm:0,2pm:0,3pm:0,4pm:0,md:n}";
/// The state of an input that is not pressed.
const OPEN: &str = "0";
/// Time of the filters of the inputs, and more.
const FILTER: Duration = Duration::from_millis(100);
/// The state of a machine with an alarm.
const ALARM: &str = "2";

const PULSES: &str = "pulses at the step pin";
const AS_STEPS: &str = "as many as steps, there and back";
/// Counts after which the counter begins anew.
const COUNTS: f64 = 65_536.0;

/// Makes the checks, if the plan says that there is a jumper. `works` says whether Kerf answers.
pub async fn check(
    line: &mut Line<'_, impl Board>,
    plan: &Plan,
    works: &Result<(), String>,
    report: &mut Report,
) {
    let hindrance = match works {
        _ if plan.jumpers.is_none() => Some("there is no jumper"),
        _ if plan.dialect.name != TINYG.name => Some("only in TinyG's dialect"),
        Err(why) => Some(why.as_str()),
        Ok(()) => None,
    };
    let counts = plan.jumpers.is_some_and(|jumpers| jumpers.counts);
    let uncounted = (!counts).then_some("the image uses the counter itself, or has none");
    let mut kerf = Kerf::new(line, plan.dialect);
    match hindrance.or(uncounted) {
        Some(why) => report.leave_out(PULSES, AS_STEPS, why),
        None => {
            let result = pulses(&mut kerf).await;
            report.add_and_tell(kerf.line().board(), PULSES, AS_STEPS, result);
        }
    }
    match hindrance {
        Some(why) => report.leave_out(NAME, WANTED, why),
        None => {
            let result = latency(&mut kerf).await;
            report.add_and_tell(kerf.line().board(), NAME, WANTED, result);
        }
    }
}

/// Moves X there and back, and counts.
async fn pulses(kerf: &mut Kerf<'_, '_, impl Board>) -> Checked {
    let before = kerf.borrow(SWITCHES.iter()).await?;
    let result = counted(kerf).await;
    let again = kerf.restart().await;
    and_restored(result, again.and(kerf.give_back(&before).await))
}

async fn counted(kerf: &mut Kerf<'_, '_, impl Board>) -> Checked {
    kerf.restart().await?;
    for line in [NO_SWITCH, NO_POWER, "g21", "g94", "g91"] {
        kerf.ask(line).await?;
    }
    let scale = kerf.scale().await?;
    let first = kerf.number("pls").await?;
    kerf.ask(&format!("g1 x{LENGTH} f{SPEED}")).await?;
    kerf.rest().await?;
    let [there, ..] = kerf.steps(&scale).await?;
    kerf.ask(&format!("g0 x-{LENGTH}")).await?;
    kerf.rest().await?;
    let [home, ..] = kerf.steps(&scale).await?;
    let steps = there.abs() + (there - home).abs();
    let pulses = (kerf.number("pls").await? - first).rem_euclid(COUNTS);
    let text = format!("{pulses} pulses, {steps} steps");
    judged(steps > 0.0 && pulses == steps.rem_euclid(COUNTS), text)
}

/// Measures, and restores the settings.
async fn latency(kerf: &mut Kerf<'_, '_, impl Board>) -> Checked {
    let before = kerf.borrow(SWITCHES.iter()).await?;
    let result = with_either_polarity(kerf).await;
    let again = kerf.restart().await;
    and_restored(result, again.and(kerf.give_back(&before).await))
}

/// The direction pin may be high or low for X-, which must close the switch. So both polarities are tried.
async fn with_either_polarity(kerf: &mut Kerf<'_, '_, impl Board>) -> Checked {
    for polarity in [0, 1] {
        kerf.restart().await?;
        kerf.ask(NO_SWITCH).await?;
        kerf.ask(NO_POWER).await?;
        kerf.ask(&format!("{{1po:{polarity}}}")).await?;
        // On the exact path X turns at the corner, and not before it.
        for line in ["g21", "g94", "g91", "g61", "g1 f800 x0.1"] {
            kerf.ask(line).await?;
        }
        kerf.rest().await?;
        kerf.ask(LIMIT).await?;
        kerf.line().pass(FILTER).await?;
        if kerf.value("in1").await? == OPEN {
            return at_speed(kerf).await;
        }
    }
    judged(false, "the switch is closed with either direction of X".into())
}

/// Moves Y, lets X turn, and counts the steps that Y still makes.
async fn at_speed(kerf: &mut Kerf<'_, '_, impl Board>) -> Checked {
    kerf.ask(&format!("g1 y{LENGTH} f{SPEED}")).await?;
    // The alarm may come before the answer, and refuse the line.
    let _ = kerf.ask(&format!("g1 x-0.1 y{LENGTH} f{SPEED}")).await;
    let scale = kerf.scale().await?;
    let rate = SPEED / 60.0 * scale[1];
    kerf.rest().await?;
    let [_, y, _] = kerf.steps(&scale).await?;
    let at_switch = (LENGTH * scale[1]).round();
    if y == 2.0 * at_switch {
        return judged(
            false,
            "X turns, and the switch does not stop the machine: no jumper?".into(),
        );
    }
    let (state, input) = (kerf.value("stat").await?, kerf.value("in1").await?);
    if state != ALARM || input == OPEN {
        return Err(format!("not the switch has stopped the machine: state {state}, in1 {input}"));
    }
    let more = y - at_switch;
    let most = (LONGEST * rate).ceil() + 1.0;
    let text = format!("step {more} after the switch was the last one, at {rate:.0} steps/s");
    judged((0.0..=most).contains(&more), text)
}
