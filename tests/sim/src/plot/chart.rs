//! The picture, as SVG.

use std::ops::Range;

use anyhow::{Result, anyhow};
use plotters::coord::Shift;
use plotters::prelude::*;

use super::{Axis, Motion};
use crate::track::SAMPLE_S;

const WIDTH: u32 = 1_100;
const PATH_HEIGHT: u32 = 640;
const CURVE_HEIGHT: u32 = 220;
const THREADS_HEIGHT: u32 = 300;
/// Least range of the scale of errors, micrometres to each side.
const THREAD_SCALE: f64 = 10.0;
/// Only every so many samples of a thread are drawn.
const THREAD_EVERY: usize = 4;
const MARGIN: u32 = 12;
const LABELS_BELOW: u32 = 38;
const LABELS_LEFT: u32 = 76;
/// Width of the colour scale.
const SCALE: u32 = 110;
/// Steps of the colour scale: as many as can be told apart.
const COLOURS: usize = 16;
/// Columns of a curve. If there are more samples, each column shows its highest and its lowest.
const COLUMNS: usize = 700;
/// How far a simplified path may be off, as a share of its size.
const SIMPLER: f64 = 1.0 / 2_000.0;
const FONT: (&str, u32) = ("sans-serif", 13);
/// Height of the line that names the axes, and the width of an axis in it.
const LEGEND: u32 = 24;
const LEGEND_STEP: i32 = 150;
/// The colours of the axes that move, in order.
const AXES: [RGBColor; 6] = [
    RGBColor(196, 40, 40),
    RGBColor(30, 130, 60),
    RGBColor(40, 80, 200),
    RGBColor(190, 120, 0),
    RGBColor(130, 60, 170),
    RGBColor(0, 140, 150),
];
/// A limit is drawn if it is no more than so many times the largest value.
const LIMITS_UP_TO: f64 = 3.0;

/// What a panel of curves shows.
struct Quantity {
    name: &'static str,
    /// The windows between positions that it is computed from.
    windows: f64,
    values: fn(&Axis) -> &[f64],
    limit: fn(&Axis) -> f64,
}

const QUANTITIES: [Quantity; 3] = [
    Quantity {
        name: "velocity, mm/s",
        windows: 2.0,
        values: |axis| &axis.curves.velocity,
        limit: |axis| axis.limits.velocity,
    },
    Quantity {
        name: "acceleration, mm/s²",
        windows: 1.0,
        values: |axis| &axis.curves.acceleration,
        limit: |axis| axis.limits.acceleration,
    },
    Quantity {
        name: "jerk, mm/s³",
        windows: 2.0,
        values: |axis| &axis.curves.jerk,
        limit: |axis| axis.limits.jerk,
    },
];

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// Draws all panels. `span`, in s, limits the curves to that time.
///
/// `threads` go below them: for each pass, the positions along Z and the errors there, mm. `heat` comes last: the
/// temperatures of each heater in degrees, over seconds from the start. Both may be empty.
pub fn draw(
    motion: &Motion,
    span: Option<Range<f64>>,
    threads: &[Points],
    heat: &[Points],
) -> Result<String> {
    let mut svg = String::new();
    panels(&mut svg, motion, span, threads, heat).map_err(|e| anyhow!("cannot draw: {e}"))?;
    Ok(svg)
}

/// Points of a curve.
pub type Points = Vec<(f64, f64)>;

type Drawn = Result<(), Box<dyn std::error::Error>>;

fn panels(
    svg: &mut String,
    motion: &Motion,
    span: Option<Range<f64>>,
    threads: &[Points],
    heat: &[Points],
) -> Drawn {
    let curves_height = 3 * CURVE_HEIGHT;
    let below = if threads.is_empty() { 0 } else { THREADS_HEIGHT };
    let heat_height = if heat.is_empty() { 0 } else { CURVE_HEIGHT };
    let size = (WIDTH, PATH_HEIGHT + curves_height + below + heat_height);
    let root = SVGBackend::with_string(svg, size).into_drawing_area();
    root.fill(&WHITE)?;
    let (top, rest) = root.split_vertically(PATH_HEIGHT);
    let (rest, errors) = rest.split_vertically(curves_height);
    let (errors, temperatures) = errors.split_vertically(below);
    if !heat.is_empty() {
        temperature(&temperatures, heat)?;
    }
    if !threads.is_empty() {
        thread_errors(&errors, threads)?;
    }
    let (plane, scale) = top.split_horizontally(WIDTH - SCALE);
    let fastest = motion.speed.iter().copied().fold(0.0, f64::max).max(1e-9);
    path(&plane, motion, fastest)?;
    colour_scale(&scale, fastest)?;
    let all = 0.0..motion.speed.len() as f64 * SAMPLE_S;
    let span = span.unwrap_or(all);
    for (area, quantity) in rest.split_evenly((3, 1)).iter().zip(&QUANTITIES) {
        curves(area, motion, quantity, &span)?;
    }
    root.present()?;
    Ok(())
}

/// Draws the temperature of each heater over time: the first heater in red, others in blue.
fn temperature(area: &Area<'_>, heaters: &[Points]) -> Drawn {
    let all = || heaters.iter().flatten();
    let time = extent(all().map(|point| point.0));
    let degrees = extent(all().map(|point| point.1).chain([0.0]));
    let mut chart = ChartBuilder::on(area)
        .margin(MARGIN)
        .margin_right(2 * MARGIN)
        .x_label_area_size(LABELS_BELOW)
        .y_label_area_size(LABELS_LEFT)
        .build_cartesian_2d(time, degrees.start..degrees.end * 1.06)?;
    let mut mesh = chart.configure_mesh();
    mesh.x_desc("time from the start, s").y_desc("temperature, °C").label_style(FONT);
    mesh.y_labels(7).max_light_lines(0).draw()?;
    for (n, points) in heaters.iter().enumerate() {
        let colour = if n == 0 { RED } else { BLUE };
        let points = points.iter().step_by(points.len() / COLUMNS + 1).copied();
        chart.draw_series(LineSeries::new(points, &colour))?;
    }
    Ok(())
}

/// Draws the error of a thread over its length, in micrometres.
fn thread_errors(area: &Area<'_>, passes: &[Points]) -> Drawn {
    let all = || passes.iter().flatten();
    let along = extent(all().map(|point| point.0));
    let off = extent(all().map(|point| 1e3 * point.1).chain([-THREAD_SCALE, THREAD_SCALE]));
    let mut chart = ChartBuilder::on(area)
        .margin(MARGIN)
        .margin_right(2 * MARGIN)
        .x_label_area_size(LABELS_BELOW)
        .y_label_area_size(LABELS_LEFT)
        .build_cartesian_2d(along, off)?;
    let mut mesh = chart.configure_mesh();
    mesh.x_desc("Z, mm").y_desc("error of the thread, µm").label_style(FONT).y_labels(7);
    mesh.max_light_lines(0).draw()?;
    let most = passes.len().max(2) - 1;
    for (n, pass) in passes.iter().enumerate() {
        let colour = colour(n * (COLOURS - 1) / most);
        let points = pass.iter().step_by(THREAD_EVERY).map(|(z, off)| (*z, 1e3 * off));
        chart.draw_series(LineSeries::new(points, &colour))?;
    }
    Ok(())
}

/// Draws the path in the plane of X and Y, or Z and X, to scale.
fn path(area: &Area<'_>, motion: &Motion, fastest: f64) -> Drawn {
    let (x, y) = frame(area, &motion.path);
    let tolerance = (x.end - x.start) * SIMPLER;
    let mut chart = ChartBuilder::on(area)
        .margin(MARGIN)
        .x_label_area_size(LABELS_BELOW)
        .y_label_area_size(LABELS_LEFT)
        .build_cartesian_2d(x, y)?;
    let mut mesh = chart.configure_mesh();
    let [across, up] = motion.plane.map(|name| format!("{name}, mm"));
    mesh.x_desc(across).y_desc(up).label_style(FONT).max_light_lines(0).draw()?;
    for (colour, points) in pieces(motion, fastest) {
        let line = simplified(&points, tolerance);
        chart.draw_series(LineSeries::new(line, colour.stroke_width(2)))?;
    }
    Ok(())
}

/// Returns ranges that hold all points with a little margin, at the same scale both ways.
fn frame(area: &Area<'_>, points: &[(f64, f64)]) -> (Range<f64>, Range<f64>) {
    let (width, height) = area.dim_in_pixel();
    let inner = |size: u32, labels: u32| f64::from(size - 2 * MARGIN - labels);
    let (width, height) = (inner(width, LABELS_LEFT), inner(height, LABELS_BELOW));
    let xs = extent(points.iter().map(|p| p.0));
    let ys = extent(points.iter().map(|p| p.1));
    let unit = ((xs.end - xs.start) / width).max((ys.end - ys.start) / height) * 1.06;
    let around = |range: Range<f64>, pixels: f64| {
        let middle = f64::midpoint(range.start, range.end);
        middle - unit * pixels / 2.0..middle + unit * pixels / 2.0
    };
    (around(xs, width), around(ys, height))
}

/// Returns the range from the lowest to the highest value, never empty.
fn extent(values: impl Iterator<Item = f64>) -> Range<f64> {
    let (low, high) = values.fold((f64::MAX, f64::MIN), |(l, h), v| (l.min(v), h.max(v)));
    if low > high { -1.0..1.0 } else { low..high.max(low + 1e-3) }
}

/// Cuts the path into pieces of one colour, each joined to the next.
fn pieces(motion: &Motion, fastest: f64) -> Vec<(RGBColor, Vec<(f64, f64)>)> {
    let step =
        |velocity: f64| (velocity / fastest * (COLOURS - 1) as f64).round().max(0.0) as usize;
    let mut pieces: Vec<(usize, Vec<(f64, f64)>)> = Vec::new();
    for (point, velocity) in motion.path.iter().zip(&motion.speed) {
        let step = step(*velocity);
        match pieces.last_mut() {
            Some((of, points)) if *of == step => points.push(*point),
            last => {
                let joint = last.and_then(|(_, points)| points.last().copied());
                pieces.push((step, joint.into_iter().chain([*point]).collect()));
            }
        }
    }
    pieces.into_iter().map(|(step, points)| (colour(step), points)).collect()
}

/// Returns the colour of a step: from blue for slow, over green, to red for fast.
fn colour(step: usize) -> RGBColor {
    let share = step as f64 / (COLOURS - 1) as f64;
    let (r, g, b) = HSLColor(0.66 * (1.0 - share), 0.85, 0.42).to_backend_color().rgb;
    RGBColor(r, g, b)
}

fn colour_scale(area: &Area<'_>, fastest: f64) -> Drawn {
    let (_, height) = area.dim_in_pixel();
    let (top, bottom) = (60, height as i32 - LABELS_BELOW as i32 - MARGIN as i32);
    let step = (bottom - top) / COLOURS as i32;
    area.draw(&Text::new("mm/s", (8, top - 24), FONT))?;
    for n in 0..COLOURS {
        let lower = bottom - step * n as i32;
        let corners = [(8, lower - step), (28, lower)];
        area.draw(&Rectangle::new(corners, colour(n).filled()))?;
        let speed = fastest * n as f64 / (COLOURS - 1) as f64;
        area.draw(&Text::new(format!("{speed:.2}"), (34, lower - step / 2 - 6), FONT))?;
    }
    Ok(())
}

/// Draws a quantity of each axis over time. A dashed line is the limit of the axis of its colour.
///
/// Limits far above all curves are not drawn, because the curves would be flat then. The caption names all limits.
fn curves(area: &Area<'_>, motion: &Motion, quantity: &Quantity, span: &Range<f64>) -> Drawn {
    let shown: Vec<Points> =
        motion.axes.iter().map(|axis| columns((quantity.values)(axis), span)).collect();
    let all = || shown.iter().flatten().map(|point| point.1);
    let most = all().map(f64::abs).fold(0.0, f64::max);
    let is_near = |limit: &f64| *limit <= LIMITS_UP_TO * most;
    let limits: Vec<_> = motion.axes.iter().map(|axis| (quantity.limit)(axis)).collect();
    let lines = || limits.iter().copied().filter(is_near).flat_map(|limit| [-limit, limit]);
    let range = extent(all().chain(lines()).chain([0.0]));
    let around = (range.end - range.start) * 0.06;
    let mut chart = ChartBuilder::on(area)
        .margin(MARGIN)
        .margin_top(LEGEND)
        .margin_right(2 * MARGIN)
        .x_label_area_size(LABELS_BELOW)
        .y_label_area_size(LABELS_LEFT)
        .build_cartesian_2d(span.clone(), range.start - around..range.end + around)?;
    let mut mesh = chart.configure_mesh();
    mesh.x_desc("time, s").y_desc(quantity.name).label_style(FONT).y_labels(7);
    mesh.max_light_lines(0).draw()?;
    for (n, (points, limit)) in shown.into_iter().zip(&limits).enumerate() {
        chart.draw_series(LineSeries::new(points, &AXES[n % AXES.len()]))?;
        for level in [-limit, *limit].into_iter().filter(|_| is_near(limit)) {
            let line = [(span.start, level), (span.end, level)];
            let dashed = DashedLineSeries::new(line, 6, 5, AXES[n % AXES.len()].stroke_width(1));
            chart.draw_series(dashed)?;
        }
    }
    legend(area, motion, quantity, &limits)
}

/// Writes the names of the axes, each in its colour with its limit, and the times over which values are taken.
fn legend(area: &Area<'_>, motion: &Motion, quantity: &Quantity, limits: &[f64]) -> Drawn {
    let mut x = LABELS_LEFT as i32 + MARGIN as i32;
    for (n, (axis, limit)) in motion.axes.iter().zip(limits).enumerate() {
        let text = match limit.is_finite() {
            true => format!("{}, limit {limit:.0}", axis.name),
            false => format!("{}, no limit", axis.name),
        };
        let style = TextStyle::from(FONT).color(&AXES[n % AXES.len()]);
        area.draw(&Text::new(text, (x, 4), style))?;
        x += LEGEND_STEP;
    }
    let ms = 1e3 * motion.window_s * quantity.windows;
    let text = format!("from positions {ms:.0} ms apart");
    area.draw(&Text::new(text, (x, 4), FONT))?;
    Ok(())
}

/// Returns the samples of a span. If they are many, returns the lowest and the highest of each column.
fn columns(values: &[f64], span: &Range<f64>) -> Vec<(f64, f64)> {
    let index = |time: f64| ((time / SAMPLE_S).max(0.0) as usize).min(values.len());
    let (from, to) = (index(span.start), index(span.end));
    let samples: Vec<(f64, f64)> = (from..to).map(|n| (n as f64 * SAMPLE_S, values[n])).collect();
    if samples.len() <= 2 * COLUMNS {
        return samples;
    }
    let column = |points: &[(f64, f64)]| {
        let by = |a: &&(f64, f64), b: &&(f64, f64)| a.1.total_cmp(&b.1);
        let (low, high) = (points.iter().min_by(by), points.iter().max_by(by));
        let mut two = [low, high].map(|p| p.copied().unwrap_or_default());
        two.sort_by(|a, b| a.0.total_cmp(&b.0));
        two
    };
    samples.chunks(samples.len().div_ceil(COLUMNS)).flat_map(column).collect()
}

/// Returns the corners that a line needs to stay within `tolerance` (Douglas and Peucker).
fn simplified(points: &[(f64, f64)], tolerance: f64) -> Vec<(f64, f64)> {
    let Some(last) = points.len().checked_sub(1) else { return Vec::new() };
    let mut keep = vec![false; points.len()];
    let mut spans = vec![(0, last)];
    (keep[0], keep[last]) = (true, true);
    while let Some((from, to)) = spans.pop() {
        let off = |n: usize| distance(points[n], points[from], points[to]);
        let farthest = (from + 1..to).max_by(|a, b| off(*a).total_cmp(&off(*b)));
        if let Some(n) = farthest.filter(|n| off(*n) > tolerance) {
            keep[n] = true;
            spans.extend([(from, n), (n, to)]);
        }
    }
    points.iter().zip(keep).filter(|(_, keep)| *keep).map(|(point, _)| *point).collect()
}

/// Distance of a point from the segment between two other points.
fn distance(p: (f64, f64), a: (f64, f64), b: (f64, f64)) -> f64 {
    let (dx, dy) = (b.0 - a.0, b.1 - a.1);
    let square = dx * dx + dy * dy;
    let along = ((p.0 - a.0) * dx + (p.1 - a.1) * dy) / square.max(1e-18);
    let along = along.clamp(0.0, 1.0);
    (p.0 - a.0 - along * dx).hypot(p.1 - a.1 - along * dy)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn straight_lines_need_two_points() {
        let line: Vec<_> = (0..100).map(|n| (f64::from(n), 2.0 * f64::from(n))).collect();
        assert_eq!(simplified(&line, 0.01), [line[0], line[99]]);
        let corner = [(0.0, 0.0), (1.0, 0.0), (2.0, 0.0), (2.0, 1.0), (2.0, 2.0)];
        assert_eq!(simplified(&corner, 0.01), [corner[0], corner[2], corner[4]]);
    }

    #[test]
    fn columns_keep_the_extremes() {
        let values: Vec<f64> = (0..50_000).map(|n| if n == 31_234 { 9.0 } else { 1.0 }).collect();
        let shown = columns(&values, &(0.0..50.0));
        assert!(shown.len() <= 2 * COLUMNS);
        assert!(shown.iter().any(|p| p.1 == 9.0));
        assert!(shown.windows(2).all(|w| w[0].0 <= w[1].0));
    }
}
