//! `kerf check`: a dry run of a job. The firmware itself runs the job on the host, in mocked time. So refused lines,
//! the travel of the axes and the time are those of the machine.
//!
//! | module | contents |
//! |---|---|
//! | [`around`] | the machine, with a spindle and heaters that do as they are told |
//! | [`dialect`] | the dialect of a file, and the meaning of the machine's lines |
//! | [`lines`] | which lines are sent, and how |
//! | [`stream`] | a sender that counts answers |
//! | [`told`] | the result as text |

mod around;
mod dialect;
mod lines;
mod stream;
mod told;

use kerf::config::machines;

use around::{AXES, Around};
use dialect::Dialect;
use stream::{Stream, Streamed};

/// Pulses a turn of the encoder at the spindle of a lathe whose settings have none.
const PULSES: &str = "{spn:4}";

/// If more lines than this are answered in some second, the board may be slower than the dry run, which does not
/// simulate the board's CPU. An empty queue takes 64 lines at once. At 400 lines a second the board's time agrees
/// within 1 %.
const MOST_LINES: usize = 64 + 400;

/// The input of a dry run.
pub struct Question<'a> {
    /// The name of the machine's profile.
    pub machine: &'a str,
    /// The name of the dialect; `None` for that which the file looks like.
    pub dialect: Option<&'a str>,
    /// Settings that are sent before the job.
    pub settings: &'a [String],
    /// The work zero in machine coordinates, if it is known.
    pub zero: Option<[f64; 3]>,
}

/// The travel of an axis in the job, in mm from the work zero, and the travel that is allowed.
struct Extent {
    axis: &'static str,
    from: f64,
    to: f64,
    travel: (f64, f64),
    /// The work zero, in machine coordinates, if it is known.
    zero: Option<f64>,
}

/// The result of a dry run.
pub struct Answer {
    dialect: Dialect,
    /// Why the job was sent in this dialect.
    because: String,
    streamed: Streamed,
    extents: Vec<Extent>,
    ms: u64,
}

/// Runs a job. The error says why it could not begin.
pub fn check(job: &[u8], question: &Question) -> Result<Answer, String> {
    let text = String::from_utf8_lossy(job);
    let (dialect, because) = match question.dialect {
        Some(name) => (Dialect::named(name)?, "--dialect".to_string()),
        None => Dialect::of(&text),
    };
    let machine = machines::ALL.iter().position(|m| m.name == question.machine);
    let known = || machines::ALL.map(|machine| machine.name).join(", ");
    let machine =
        machine.ok_or_else(|| format!("no machine {}; there are {}", question.machine, known()))?;
    let mut around = Around::boot(dialect).ok_or("the machine does not start")?;
    let zero = prepare(&mut around, dialect, machine, question)?;
    around.open(dialect);
    if text.lines().any(lines::taps) {
        around.make_inert();
    }
    let began = around.begin();
    let stream = Stream::new(&mut around, dialect, zero, longest_dwell_ms(&text));
    let streamed = stream.run(lines::of(job, dialect))?;
    let ms = around.ms - began + streamed.skipped_ms;
    // A printer has no work zero: its files are in machine coordinates.
    let known = question.zero.or((dialect == Dialect::RepRap).then_some(zero));
    let extents = (0..AXES.len()).filter_map(|n| {
        let (low, high) = around.went(n)?;
        let (axis, travel) = (AXES[n], around.axes[n].travel);
        let (from, to) = (low - zero[n], high - zero[n]);
        Some(Extent { axis, from, to, travel, zero: known.map(|zero| zero[n]) })
    });
    let extents = extents.collect();
    Ok(Answer { dialect, because, streamed, extents, ms })
}

/// Sets the machine up. It counts as homed, and stands where homing ends. Returns the work zero.
fn prepare(
    around: &mut Around,
    dialect: Dialect,
    machine: usize,
    question: &Question,
) -> Result<[f64; 3], String> {
    around.set(&format!("{{mch:{machine}}}"))?;
    if machines::ALL[machine].name == "lathe" {
        around.set(PULSES)?;
    }
    for line in question.settings {
        around.set(line)?;
    }
    // Stops do not wait, because there is no operator. Reports are off, because they would take time on the line.
    around.set("{psw:0,sl:0,sv:0,qv:0,jv:3}")?;
    around.set("{ej:1}")?;
    around.learn(dialect == Dialect::RepRap)?;
    let homed = around.axes.map(|axis| axis.homed);
    let usual = if dialect == Dialect::RepRap { [0.0; 3] } else { homed };
    let zero = question.zero.unwrap_or(usual);
    around.set(&format!("g21 g28.3 x{} y{} z{}", homed[0], homed[1], homed[2]))?;
    around.set(&format!("g10 l2 p1 x{} y{} z{}", zero[0], zero[1], zero[2]))?;
    Ok(zero)
}

/// Returns an upper bound of the dwells of a job, ms: the largest P or S of its lines with G4 or a cycle, as seconds. A
/// cycle repeats its dwell in the lines behind it.
fn longest_dwell_ms(text: &str) -> u64 {
    let dwells = text.lines().filter_map(|line| {
        let code = lines::bare(line);
        let dwells = ["G4", "G04", "G8"].into_iter().find_map(|of| code.split_once(of));
        let digits = dwells?.1.split_once(['P', 'S'])?.1;
        let end = digits.find(|c: char| !(c.is_ascii_digit() || c == '.')).unwrap_or(digits.len());
        digits.get(..end)?.parse::<f64>().ok()
    });
    (dwells.fold(0.0, f64::max) * 1e3) as u64
}

impl Extent {
    fn fits(&self) -> bool {
        let (lower, upper) = self.travel;
        // If both ends are equal the axis has no limits.
        let slack = 0.01;
        lower == upper
            || match self.zero {
                Some(zero) => self.from + zero >= lower - slack && self.to + zero <= upper + slack,
                None => self.to - self.from <= upper - lower + slack,
            }
    }
}

impl Answer {
    /// Returns the time that the job takes, s.
    #[allow(dead_code)]
    pub fn seconds(&self) -> f64 {
        self.ms as f64 / 1e3
    }

    /// Whether the board may take longer than the dry run says.
    pub fn is_rushed(&self) -> bool {
        self.streamed.busiest > MOST_LINES
    }

    /// Whether the machine would run the whole job: every line was read, none was refused, and nothing stops it.
    pub fn is_good(&self) -> bool {
        let Streamed { refused, stops, .. } = &self.streamed;
        refused.is_empty() && stops.is_empty() && self.extents.iter().all(Extent::fits)
    }
}
