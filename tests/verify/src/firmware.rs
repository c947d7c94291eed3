//! The checks of Kerf on the board.
//!
//! | check | how |
//! |---|---|
//! | Kerf | it is flashed, greets, and tells its version |
//! | settings | values are stored, the board is reset, the values are read and restored |
//! | clock of Kerf | a dwell of ten seconds |
//! | check mode | the job is accepted, a wrong line in it is refused, nothing moves |
//! | job | the job runs, with the drivers off where the dialect can do that: steps half way and at the end |
//! | late segments | Kerf's own count of segments that came too late |

use std::time::Duration;

use crate::Plan;
use crate::board::{Board, Image};
use crate::dialect::{Dialect, Each, ForJob, Question, Stored, tinyg};
use crate::job::{Job, is_exact, out_and_back};
use crate::line::Line;
use crate::random::Random;
use crate::report::{Checked, Report, and_restored, judged};

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
/// How often the values of before are stored until they are read.
const RESTORES: usize = 2;
/// Fewest steps of an axis half way through the job: fewer would not tell a step that is missing.
const FEWEST: f64 = 50.0;
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
            Check::Job => "job",
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
    fn hindrance(self, plan: &Plan, has_run: bool) -> Option<&'static str> {
        match self {
            Check::Tried if plan.dialect.check_mode.is_none() => Some("the dialect has none"),
            Check::Late if plan.dialect.late.is_none() => Some("the dialect does not tell them"),
            Check::Late if !has_run => Some("no job has run"),
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

/// Makes all checks. The error says why Kerf is not on the board, or does not answer.
pub async fn check(
    line: &mut Line<'_, impl Board>,
    plan: &Plan,
    report: &mut Report,
) -> Result<(), String> {
    let mut kerf = Kerf::new(line, plan.dialect);
    let version = version(&mut kerf, plan).await;
    let mut start = version.as_ref().map(|_| ()).map_err(Clone::clone);
    let wanted = "answers, and has the version of this source";
    report.add_and_tell(kerf.line.board(), "Kerf", wanted, version);
    let mut has_run = false;
    for one in Check::ALL {
        let hindrance = one.hindrance(plan, has_run).map(str::to_owned);
        if let Some(why) = start.as_ref().err().cloned().or(hindrance) {
            report.leave_out(one.name(), one.wanted(), &why);
            continue;
        }
        kerf.line.board().tell(one.name());
        let result = one.run(&mut kerf, plan).await;
        let again = result.is_err();
        has_run = matches!(one, Check::Job) && !again;
        report.add_and_tell(kerf.line.board(), one.name(), one.wanted(), result);
        if again {
            start = kerf.restart().await;
        }
    }
    start
}

/// A value, and what it was.
pub(crate) type Borrowed<'v> = (&'v Stored, String);

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

    async fn greeting(&mut self) -> Result<(), String> {
        self.line.until(START, self.dialect.is_greeting).await?;
        self.line.pass(SETTLE).await?;
        if let Some(line) = self.dialect.opening {
            self.ask(line).await?;
        }
        Ok(())
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
        let (lines, refusal) = self.answer(longest, request).await?;
        refusal.map_or(Ok(lines), |why| Err(format!("{request} is refused: {why}")))
    }

    /// Sends a request. Returns all lines up to its answer, and the refusal if it is one.
    async fn answer(
        &mut self,
        longest: Duration,
        request: &str,
    ) -> Result<(Vec<String>, Option<String>), String> {
        self.line.forget().await?;
        self.line.say(request).await?;
        let answer = self.dialect.answer;
        let lines = self.line.until(longest, |line| answer(line).is_some()).await;
        let lines = lines.map_err(|why| format!("{request}: {why}"))?;
        let refusal = lines.last().and_then(|last| answer(last)).and_then(Result::err);
        Ok((lines, refusal))
    }

    /// Reads values that a check is going to change.
    pub(crate) async fn borrow<'v>(
        &mut self,
        values: impl Iterator<Item = &'v Stored>,
    ) -> Result<Vec<Borrowed<'v>>, String> {
        let mut before = Vec::new();
        for value in values {
            before.push((value, self.read(value).await?));
        }
        Ok(before)
    }

    /// Stores the values that were there before, and reads them back. The error says which are not as before.
    pub(crate) async fn give_back(&mut self, before: &[Borrowed<'_>]) -> Result<(), String> {
        let mut left = Vec::new();
        for _ in 0..RESTORES {
            for (value, text) in before {
                // What fails is noticed when it is read.
                let _ = self.store(value, text).await;
            }
            let _ = self.line.pass(STORE).await;
            left.clear();
            for (value, text) in before {
                if self.read(value).await.as_ref() != Ok(text) {
                    left.push((value.store)(text).join(" "));
                }
            }
            if left.is_empty() {
                return Ok(());
            }
            let _ = self.restart().await;
        }
        Err(format!("NOT RESTORED, please send: {}", left.join(", ")))
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

    /// Returns a value by its name as a number, in TinyG's dialect.
    pub(crate) async fn number(&mut self, name: &str) -> Result<f64, String> {
        let text = self.value(name).await?;
        text.parse().map_err(|_| format!("{name} is {text:?}, no number"))
    }

    pub(crate) async fn read(&mut self, value: &Stored) -> Result<String, String> {
        let lines = self.ask(value.read).await?;
        (value.find)(&lines).ok_or_else(|| format!("{} is not answered: {lines:?}", value.read))
    }

    pub(crate) async fn store(&mut self, value: &Stored, text: &str) -> Result<(), String> {
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
    let others: Vec<_> = values.iter().map(|value| (value.other)(&mut random)).collect();
    let before = kerf.borrow(values.iter()).await?;
    let result = kept(kerf, values, &others).await.and_then(|changed| match changed.is_empty() {
        true => judged(true, format!("{} values", values.len())),
        false => judged(false, changed.join("; ")),
    });
    and_restored(result, kerf.give_back(&before).await)
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

/// A short dwell shows what the conversation takes.
async fn clock(kerf: &mut Kerf<'_, '_, impl Board>, plan: &Plan) -> Checked {
    let ms = plan.seconds * 1_000;
    let short = dwell(kerf, 100).await?;
    let took = dwell(kerf, ms + 100).await? - short;
    if took < f64::from(ms) / 2_000.0 {
        return Err(format!("a dwell of {ms} ms takes {took:.3} s"));
    }
    let ppm = (f64::from(ms) / 1_000.0 / took - 1.0) * 1e6;
    judged(ppm.abs() <= CLOCK_PPM, format!("{ppm:+.0} ppm against this computer's clock"))
}

/// Half of the job, so that a machine that moves all the same ends elsewhere than it began.
async fn check_mode(kerf: &mut Kerf<'_, '_, impl Board>) -> Checked {
    let [on, off] = kerf.dialect.check_mode.unwrap_or_default();
    let scale = kerf.scale().await?;
    let before = kerf.steps(&scale).await?;
    kerf.ask(on).await?;
    for line in kerf.dialect.before_job.iter().filter(|line| line.starts_with(['G', 'g'])) {
        kerf.ask(line).await?;
    }
    let [out, _] = out_and_back();
    for line in &out.lines {
        kerf.ask(line).await?;
    }
    let (_, refusal) = kerf.answer(ANSWER, WRONG).await?;
    kerf.line.pass(SETTLE).await?;
    let steps = kerf.steps(&scale).await?;
    kerf.ask(off).await?;
    kerf.line.pass(SETTLE).await?;
    match refusal {
        None => judged(false, format!("the wrong line {WRONG:?} is accepted")),
        Some(_) => judged(steps == before, format!("{} lines; steps {steps:?}", out.lines.len())),
    }
}

/// Runs the job from a reset on, so that it begins at 0.
async fn job(kerf: &mut Kerf<'_, '_, impl Board>) -> Checked {
    let values = kerf.dialect.for_job;
    let before = kerf.borrow(values.iter().map(|one| &one.value)).await?;
    let result = prepared(kerf, values).await;
    let again = if result.is_err() { kerf.restart().await } else { Ok(()) };
    let restored = kerf.give_back(&before).await;
    and_restored(result, again.and(restored))
}

/// Stores what the job needs, and runs it if that has been kept in a reset.
async fn prepared(kerf: &mut Kerf<'_, '_, impl Board>, values: &[ForJob]) -> Checked {
    for ForJob { value, needed } in values {
        kerf.store(value, needed).await?;
    }
    kerf.line.pass(STORE).await?;
    kerf.restart().await?;
    for ForJob { value, needed } in values {
        let found = kerf.read(value).await?;
        if found != *needed {
            return Err(format!("the job does not run: {} answers {found}", value.read));
        }
    }
    from_reset(kerf).await
}

/// Runs the job from the position 0 on.
async fn from_reset(kerf: &mut Kerf<'_, '_, impl Board>) -> Checked {
    for line in kerf.dialect.before_job {
        kerf.ask(line).await?;
    }
    let scale = kerf.scale().await?;
    let [out, back] = out_and_back();
    let mut ways = out.at.iter().zip(&scale).map(|(mm, scale)| mm * scale);
    if !ways.all(|way| way.is_finite() && way >= FEWEST) {
        return Err(format!("too few steps/mm to tell a step: {scale:?}"));
    }
    let there = run(kerf, &out, &scale).await?;
    let home = run(kerf, &back, &scale).await?;
    let lines = out.lines.len() + back.lines.len();
    let is_sound = there.is_exact && home.is_exact;
    let drivers = kerf.dialect.drivers;
    let text =
        format!("{lines} lines; {} half way, {} at the end; {drivers}", there.text, home.text);
    judged(is_sound, text)
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
