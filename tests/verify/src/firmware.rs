//! The checks of Kerf on the board.
//!
//! | check | how |
//! |---|---|
//! | Kerf | it is flashed, greets, and tells its version |
//! | settings | values are stored, the board is reset, the values are read and restored |
//! | clock of Kerf | a dwell of ten seconds |
//! | check mode | the job is accepted, a wrong line in it is refused, nothing moves |
//! | job | the job runs with the drivers off: steps half way and at the end |
//! | late segments | Kerf's own count of segments that came too late |

use std::time::Duration;

use crate::Plan;
use crate::board::{Board, Image};
use crate::dialect::{AXES, Dialect, Each, ForJob, Question, Stored, tinyg};
use crate::job::{Job, is_exact, out_and_back};
use crate::line::Line;
use crate::random::Random;
use crate::report::{Checked, Report, judged};

/// Longest time from a reset to the greeting. The boot loader waits for a second; early bytes make it wait for five
/// more.
const START: Duration = Duration::from_secs(8);
/// Longest time of an answer. A line of a job waits until there is room for its move.
const ANSWER: Duration = Duration::from_secs(10);
/// Time in which everything that is waiting is stored.
const STORE: Duration = Duration::from_millis(1_500);
/// Time between two questions whether the machine is at rest.
const POLL: Duration = Duration::from_millis(2);
/// Longest time until the machine is at rest.
const REST: Duration = Duration::from_secs(60);
/// Time in which what was not asked for comes, such as a greeting.
const SETTLE: Duration = Duration::from_millis(500);
/// Greatest deviation of a clock, ppm.
const CLOCK_PPM: f64 = 10_000.0;
/// A line that every dialect refuses.
const WRONG: &str = "G1 X";

#[derive(Clone, Copy)]
enum Check {
    Settings,
    Clock,
    Tried,
    Job,
    Late,
}

impl Check {
    const ALL: [Check; 5] = [Check::Settings, Check::Clock, Check::Tried, Check::Job, Check::Late];

    fn name(self) -> &'static str {
        match self {
            Check::Settings => "settings through a reset",
            Check::Clock => "clock of Kerf",
            Check::Tried => "job in check mode",
            Check::Job => "job with the drivers off",
            Check::Late => "late segments",
        }
    }

    fn wanted(self) -> &'static str {
        match self {
            Check::Settings => "each value is kept",
            Check::Clock => "within 1 %",
            Check::Tried => "all lines but a wrong one are accepted, nothing moves",
            Check::Job => "each step, half way and at the end",
            Check::Late => "none",
        }
    }

    /// Why the check cannot be made; `None` if it can.
    fn hindrance(self, plan: &Plan) -> Option<&'static str> {
        match self {
            Check::Tried if plan.dialect.check_mode.is_none() => Some("the dialect has none"),
            Check::Late if plan.dialect.late.is_none() => Some("the dialect does not tell them"),
            _ => None,
        }
    }

    async fn run(self, kerf: &mut Kerf<'_, '_, impl Board>, plan: &Plan) -> Checked {
        match self {
            Check::Settings => settings(kerf, plan).await,
            Check::Clock => clock(kerf, plan).await,
            Check::Tried => check_mode(kerf).await,
            Check::Job => job(kerf).await,
            Check::Late => late(kerf).await,
        }
    }
}

/// Makes all checks. Returns whether Kerf is on the board and answers.
pub async fn check(line: &mut Line<'_, impl Board>, plan: &Plan, report: &mut Report) -> bool {
    let mut kerf = Kerf::new(line, plan.dialect);
    let version = version(&mut kerf, plan).await;
    let mut start = version.as_ref().map(|_| ()).map_err(Clone::clone);
    report.add("Kerf", "is flashed, and has the version of this source", version);
    kerf.tell(report);
    for one in Check::ALL {
        let hindrance = one.hindrance(plan).map(str::to_owned);
        if let Some(why) = hindrance.or(start.as_ref().err().cloned()) {
            report.leave_out(one.name(), one.wanted(), &why);
            continue;
        }
        kerf.line.board().tell(one.name());
        let result = one.run(&mut kerf, plan).await;
        let again = result.is_err();
        report.add(one.name(), one.wanted(), result);
        kerf.tell(report);
        if again {
            start = kerf.restart().await;
        }
    }
    start.is_ok()
}

/// Kerf at the other end of the line.
pub(crate) struct Kerf<'l, 'b, B> {
    line: &'l mut Line<'b, B>,
    dialect: &'static Dialect,
}

impl<'l, 'b, B: Board> Kerf<'l, 'b, B> {
    pub(crate) fn new(line: &'l mut Line<'b, B>, dialect: &'static Dialect) -> Self {
        Kerf { line, dialect }
    }

    pub(crate) fn line(&mut self) -> &mut Line<'b, B> {
        self.line
    }

    pub(crate) fn tell(&mut self, report: &Report) {
        let last = report.last_line();
        self.line.board().tell(&last);
    }

    async fn greeting(&mut self) -> Result<(), String> {
        self.line.until(START, self.dialect.is_greeting).await?;
        self.line.pass(SETTLE).await
    }

    pub(crate) async fn restart(&mut self) -> Result<(), String> {
        self.line.reset().await?;
        self.greeting().await
    }

    /// Sends a request. Returns all lines up to its answer; an error if it is refused.
    pub(crate) async fn ask(&mut self, request: &str) -> Result<Vec<String>, String> {
        self.ask_within(ANSWER, request).await
    }

    async fn ask_within(
        &mut self,
        longest: Duration,
        request: &str,
    ) -> Result<Vec<String>, String> {
        self.line.say(request).await?;
        let answer = self.dialect.answer;
        let lines = self.line.until(longest, |line| answer(line).is_some()).await;
        let lines = lines.map_err(|why| format!("{request}: {why}"))?;
        let last = lines.last().and_then(|last| answer(last)).unwrap_or(Ok(()));
        last.map(|()| lines).map_err(|why| format!("{request} is refused: {why}"))
    }

    /// Waits until the machine is at rest.
    pub(crate) async fn rest(&mut self) -> Result<(), String> {
        let end = self.line.now() + REST;
        while !self.find(&self.dialect.rest).await? {
            if self.line.now() > end {
                return Err(format!(
                    "the machine does not come to rest within {} s",
                    REST.as_secs()
                ));
            }
            self.line.pass(POLL).await?;
        }
        Ok(())
    }

    /// Returns a value by its name, in TinyG's dialect.
    pub(crate) async fn value(&mut self, name: &str) -> Result<String, String> {
        let lines = self.ask(&format!("{{{name}:n}}")).await?;
        tinyg::value(&lines, name).ok_or_else(|| format!("no {name} in {lines:?}"))
    }

    async fn read(&mut self, value: &Stored) -> Result<String, String> {
        let lines = self.ask(value.read).await?;
        (value.find)(&lines).ok_or_else(|| format!("{} is not answered: {lines:?}", value.read))
    }

    async fn store(&mut self, value: &Stored, text: &str) -> Result<(), String> {
        for request in (value.store)(text) {
            self.ask(&request).await?;
        }
        Ok(())
    }

    async fn find<T>(&mut self, question: &Question<T>) -> Result<T, String> {
        let lines = self.ask(question.request).await?;
        (question.find)(&lines).ok_or_else(|| format!("{}: {lines:?}", question.request))
    }

    pub(crate) async fn scale(&mut self) -> Result<Each, String> {
        let mut lines = Vec::new();
        for request in self.dialect.scale_requests {
            lines.extend(self.ask(request).await?);
        }
        (self.dialect.scale)(&lines).ok_or_else(|| format!("no steps/mm in {lines:?}"))
    }

    pub(crate) async fn steps(&mut self, scale: &Each) -> Result<Each, String> {
        let lines = self.ask(self.dialect.steps_request).await?;
        (self.dialect.steps)(&lines, scale).ok_or_else(|| format!("no position in {lines:?}"))
    }
}

async fn version(kerf: &mut Kerf<'_, '_, impl Board>, plan: &Plan) -> Checked {
    kerf.line.flash(Image::Kerf).await?;
    kerf.greeting().await?;
    let version = kerf.find(&kerf.dialect.version).await?;
    judged(version == plan.version, format!("Kerf {version}"))
}

/// Reads the values, stores others, resets the board, reads and restores.
async fn settings(kerf: &mut Kerf<'_, '_, impl Board>, plan: &Plan) -> Checked {
    let values = kerf.dialect.stored;
    let mut random = Random::new(plan.seed);
    let (mut before, mut others) = (Vec::new(), Vec::new());
    for value in values {
        before.push(kerf.read(value).await?);
        others.push((value.other)(&mut random));
    }
    let result = kept(kerf, values, &others).await;
    let restored = restore(kerf, values.iter().zip(&before)).await;
    let changed = result?;
    restored?;
    let measured = match changed.is_empty() {
        true => format!("{} values", values.len()),
        false => changed.join("; "),
    };
    judged(changed.is_empty(), measured)
}

/// Stores the values that were there before.
async fn restore<'v>(
    kerf: &mut Kerf<'_, '_, impl Board>,
    values: impl Iterator<Item = (&'v Stored, &'v String)>,
) -> Result<(), String> {
    for (value, text) in values {
        kerf.store(value, text).await.map_err(|why| format!("{text} is not restored: {why}"))?;
    }
    kerf.line.pass(STORE).await
}

/// Stores values, and returns what has become of those that a reset has changed.
async fn kept(
    kerf: &mut Kerf<'_, '_, impl Board>,
    values: &[Stored],
    texts: &[String],
) -> Result<Vec<String>, String> {
    for (value, text) in values.iter().zip(texts) {
        kerf.store(value, text).await?;
    }
    kerf.line.pass(STORE).await?;
    kerf.restart().await?;
    let mut changed = Vec::new();
    for (value, text) in values.iter().zip(texts) {
        let found = kerf.read(value).await?;
        if found != *text {
            changed.push(format!("{} was {text}, is {found}", (value.store)(text)[0]));
        }
    }
    Ok(changed)
}

/// Returns the time of a dwell, in seconds.
async fn dwell(kerf: &mut Kerf<'_, '_, impl Board>, ms: u32) -> Result<f64, String> {
    let start = kerf.line.now();
    let request = (kerf.dialect.dwell)(ms);
    kerf.ask_within(ANSWER + Duration::from_millis(ms.into()), &request).await?;
    kerf.rest().await?;
    Ok((kerf.line.now() - start).as_secs_f64())
}

/// A dwell of no length shows what the conversation takes.
async fn clock(kerf: &mut Kerf<'_, '_, impl Board>, plan: &Plan) -> Checked {
    let ms = plan.seconds * 1_000;
    let short = dwell(kerf, 100).await?;
    let took = dwell(kerf, ms + 100).await? - short;
    let ppm = (f64::from(ms) / 1_000.0 / took - 1.0) * 1e6;
    judged(ppm.abs() <= CLOCK_PPM, format!("{ppm:+.0} ppm against this computer's clock"))
}

async fn check_mode(kerf: &mut Kerf<'_, '_, impl Board>) -> Checked {
    let [on, off] = kerf.dialect.check_mode.unwrap_or_default();
    kerf.ask(on).await?;
    let mut lines = 0;
    for line in kerf.dialect.before_job.iter().filter(|line| line.starts_with(['G', 'g'])) {
        kerf.ask(line).await?;
    }
    let [out, back] = out_and_back();
    for line in out.lines.iter().chain(&back.lines) {
        kerf.ask(line).await?;
        lines += 1;
    }
    let refused = kerf.ask(WRONG).await;
    kerf.ask(off).await?;
    kerf.line.pass(SETTLE).await?;
    let scale = kerf.scale().await?;
    let steps = kerf.steps(&scale).await?;
    match refused {
        Ok(_) => judged(false, format!("the wrong line {WRONG:?} is accepted")),
        Err(_) => judged(steps == [0.0; AXES], format!("{lines} lines; steps {steps:?}")),
    }
}

/// Runs the job from a reset on, so that it begins at 0.
async fn job(kerf: &mut Kerf<'_, '_, impl Board>) -> Checked {
    let mut before = Vec::new();
    for ForJob { value, needed } in kerf.dialect.for_job {
        before.push(kerf.read(value).await?);
        kerf.store(value, needed).await?;
    }
    kerf.line.pass(STORE).await?;
    let result = from_reset(kerf).await;
    let again = if result.is_err() { kerf.restart().await } else { Ok(()) };
    let values = kerf.dialect.for_job.iter().map(|one| &one.value);
    let restored = restore(kerf, values.zip(&before)).await;
    let judged = result?;
    again.and(restored).map(|()| judged)
}

async fn from_reset(kerf: &mut Kerf<'_, '_, impl Board>) -> Checked {
    kerf.restart().await?;
    for line in kerf.dialect.before_job {
        kerf.ask(line).await?;
    }
    let scale = kerf.scale().await?;
    let [out, back] = out_and_back();
    let there = run(kerf, &out, &scale).await?;
    let home = run(kerf, &back, &scale).await?;
    let lines = out.lines.len() + back.lines.len();
    let is_sound = there.is_exact && home.is_exact;
    judged(is_sound, format!("{lines} lines; {} half way, {} at the end", there.text, home.text))
}

struct Arrival {
    is_exact: bool,
    text: String,
}

/// Runs a part of the job, and compares the steps with the lengths.
async fn run(
    kerf: &mut Kerf<'_, '_, impl Board>,
    job: &Job,
    scale: &Each,
) -> Result<Arrival, String> {
    for line in &job.lines {
        kerf.ask(line).await?;
    }
    kerf.rest().await?;
    let steps = kerf.steps(scale).await?;
    let mut each = steps.iter().zip(job.at).zip(scale);
    let is_exact = each.all(|((steps, mm), scale)| is_exact(*steps, mm, *scale));
    let [x, y, z] = steps;
    let mut text = format!("X{x} Y{y} Z{z}");
    if !is_exact {
        let wanted: Vec<_> = job.at.iter().zip(scale).map(|(mm, scale)| mm * scale).collect();
        text += &format!(" in place of {wanted:?}");
    }
    Ok(Arrival { is_exact, text })
}

async fn late(kerf: &mut Kerf<'_, '_, impl Board>) -> Checked {
    let Some(question) = &kerf.dialect.late else { return judged(false, "no number".into()) };
    let late = kerf.find(question).await?;
    judged(late == "0", format!("{late} in the job"))
}
