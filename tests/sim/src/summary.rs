//! A report as text for readers.

use std::fmt::{self, Display, Formatter};

use crate::report::{PauseReport, Report, WindowReport};
use crate::threads::Threads;

/// Most refused lines, and lines passed over, that are shown; the rest is only counted.
const REJECTED_SHOWN: usize = 20;
/// Most pauses that are shown; the rest is only counted.
const PAUSES_SHOWN: usize = 10;

impl Display for Report {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        self.lines(f)?;
        row(
            f,
            "time",
            format!("{:.3} s moving, {:.3} s to rest", self.seconds_moving, self.seconds_to_idle),
        )?;
        self.motors(f)?;
        self.axes(f)?;
        if let Some(threads) = &self.threads {
            let Threads { passes, turns, spread_mm, most_mm, .. } = threads;
            let what = format!(
                "{passes} passes, {turns} turns, {spread_mm:.4} mm apart at the index (at most {most_mm:.4})"
            );
            row(f, "threads", what)?;
        }
        if let Some(followed) = &self.followed {
            row(f, "steps", followed)?;
        }
        for heat in &self.heat {
            row(f, heat.heater, heat)?;
        }
        for told in self.told.iter().take(REJECTED_SHOWN) {
            row(f, "passed over", told)?;
        }
        if let Some(why) = &self.unchecked {
            row(f, "ends not checked", why)?;
        }
        pauses(f, "pauses", &self.pauses)?;
        pauses(f, "step timer starved", &self.starved)?;
        row(f, "late segments", or_dash(self.late_segments))?;
        self.load(f)?;
        window(f, "interrupts off", &self.interrupts_off)?;
        window(f, "  in the step interrupt", &self.interrupts_off_in_step)?;
        let stack = self.free_stack.map_or("unknown".into(), |n| format!("{n} bytes never used"));
        row(f, "stack", stack)?;
        row(f, "UART overruns", self.uart_overruns)?;
        if self.missed_tops > 0 {
            row(f, "step timer", format!("{} tops written too late", self.missed_tops))?;
        }
        self.vectors(f)?;
        self.result(f)
    }
}

fn row(f: &mut Formatter<'_>, name: &str, value: impl Display) -> fmt::Result {
    writeln!(f, "{name:<24} {value}")
}

fn window(f: &mut Formatter<'_>, name: &str, w: &WindowReport) -> fmt::Result {
    if w.cycles == 0 {
        return row(f, name, "never");
    }
    row(f, name, format!("{} cycles ({:.1} us) in {}: {}", w.cycles, w.us, w.context, w.place))
}

/// Writes the number of pauses, the longest one, and the first few.
fn pauses(f: &mut Formatter<'_>, name: &str, pauses: &[PauseReport]) -> fmt::Result {
    let Some(longest) = pauses.iter().max_by(|a, b| a.ms.total_cmp(&b.ms)) else {
        return row(f, name, "none");
    };
    row(f, name, format!("{}, the longest {longest}", pauses.len()))?;
    for pause in pauses.iter().take(PAUSES_SHOWN) {
        row(f, "", pause)?;
    }
    if pauses.len() > PAUSES_SHOWN {
        row(f, "", format!("and {} more", pauses.len() - PAUSES_SHOWN))?;
    }
    Ok(())
}

/// Returns a number as text, or a dash.
fn or_dash(value: Option<impl Display>) -> String {
    value.map_or("-".to_string(), |v| v.to_string())
}

fn percent(share: Option<f64>) -> String {
    or_dash(share.map(|s| format!("{:.1} %", s * 100.0)))
}

impl Report {
    fn lines(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let skipped = match self.skipped {
            0 => String::new(),
            n => format!(", {n} skipped"),
        };
        let (sent, taken) = (self.lines, self.acknowledged);
        let rejected = self.rejected.len();
        row(f, "lines", format!("{sent} sent, {taken} answered, {rejected} rejected{skipped}"))?;
        for r in self.rejected.iter().take(REJECTED_SHOWN) {
            row(f, "", format!("line {:<6} status {:<4} {}", r.line, r.status, r.text))?;
        }
        if rejected > REJECTED_SHOWN {
            row(f, "", format!("and {} more", rejected - REJECTED_SHOWN))?;
        }
        Ok(())
    }

    fn motors(&self, f: &mut Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{:<9}{:>5}{:>12}{:>12}{:>12}{:>14}{:>16}{:>12}",
            "motor", "axis", "steps", "expected", "total", "highest rate", "pulse", "dir ahead"
        )?;
        for m in &self.motors {
            let rate = or_dash(m.highest_rate_hz.map(|hz| format!("{hz:.0} Hz")));
            let pulse = or_dash(m.pulse_us.map(|(a, b)| format!("{a:.2}..{b:.2} us")));
            let setup = or_dash(m.dir_setup_us.map(|us| format!("{us:.2} us")));
            writeln!(
                f,
                "{:<9}{:>5}{:>12}{:>12}{:>12}{rate:>14}{pulse:>16}{setup:>12}",
                m.motor,
                m.axis,
                m.steps,
                or_dash(m.expected),
                m.total
            )?;
        }
        Ok(())
    }

    fn axes(&self, f: &mut Formatter<'_>) -> fmt::Result {
        for a in &self.axes {
            let place = format!("{:>12.4}   expected {:>12.4}", a.position, a.expected);
            row(f, &format!("position {}", a.axis), place)?;
        }
        Ok(())
    }

    fn load(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let (all, inside) = (percent(self.cpu_load), percent(self.interrupt_load));
        row(f, "CPU load", format!("{all} awake, {inside} in interrupts"))
    }

    fn vectors(&self, f: &mut Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{:<16}{:>12}{:>12}{:>12}{:>14}",
            "interrupt", "count", "mean", "longest", "latest start"
        )?;
        for v in &self.vectors {
            writeln!(
                f,
                "{:<16}{:>12}{:>12.1}{:>12}{:>14}",
                v.vector, v.count, v.own_mean, v.own_max, v.latency_max
            )?;
        }
        Ok(())
    }

    fn result(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self.ok {
            true => writeln!(f, "result: OK"),
            false => writeln!(f, "result: FAILED ({})", self.problems.join("; ")),
        }
    }
}
