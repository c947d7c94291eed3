// The points of a chart: of a long curve the lowest and the highest value of each of `BINS` bins. Pure functions.

/// Number of bins over the width; each has two points.
const BINS = 700;
/// A limit is within the scale if it is no more than so many times the largest value: a curve far below would be flat.
const LIMITS_UP_TO = 3;

/// Returns times and the values of each curve between two times, in the form of uPlot. Of each bin there are two values
/// of each curve, its lowest and its highest in the order in which they come.
export function binned(curves, intervalMs, from, to, factor) {
  const count = curves[0]?.length ?? 0;
  const first = Math.max(Math.floor((from * 1_000) / intervalMs), 0);
  const last = Math.min(Math.ceil((to * 1_000) / intervalMs), count - 1);
  const size = Math.max((last - first + 1) / BINS, 1);
  const [times, values] = [[], curves.map(() => [])];
  for (let start = first; start <= last; start += size) {
    const [begin, end] = [Math.floor(start), Math.min(start + size, last + 1)];
    const two = end - begin > 1;
    times.push((begin * intervalMs) / 1_000);
    if (two) times.push((((begin + end) / 2) * intervalMs) / 1_000);
    curves.forEach((curve, n) => {
      let low = begin;
      let high = begin;
      for (let i = begin; i < end; i++) {
        if (curve[i] < curve[low]) low = i;
        if (curve[i] > curve[high]) high = i;
      }
      values[n].push(curve[Math.min(low, high)] * factor);
      if (two) values[n].push(curve[Math.max(low, high)] * factor);
    });
  }
  return [times, ...values];
}

/// Returns the range of a scale: all values, 0, and the limits that are near.
export function range(low, high, limits) {
  const most = Math.max(Math.abs(low), Math.abs(high));
  const near = limits.filter((limit) => limit <= LIMITS_UP_TO * most);
  const [least, greatest] = [Math.min(low, 0, ...near.map((limit) => -limit)), Math.max(high, 0, ...near)];
  return least === greatest ? [least - 1, greatest + 1] : [least * 1.06, greatest * 1.06];
}
