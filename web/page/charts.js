// Charts of velocity, acceleration and jerk over time, drawn by uPlot. The three zoom together, and share a cursor with
// the time bar.
//
// Owned by main.js. Of a long curve the lowest and the highest value of each of `BINS` bins are shown. They are
// computed again at each zoom.

import { byId } from './dom.js';
import { colour } from './theme.js';

const HEIGHT = 118;
/// Number of bins over the width; each has two points.
const BINS = 700;

/// Returns the lowest and the highest value of each bin between two times, in the order of time: times and values.
export function binned(curve, intervalMs, from, to, factor) {
  const first = Math.max(Math.floor((from * 1_000) / intervalMs), 0);
  const last = Math.min(Math.ceil((to * 1_000) / intervalMs), curve.length - 1);
  const size = Math.max((last - first + 1) / BINS, 1);
  const [times, values] = [[], []];
  const put = (i) => {
    times.push((i * intervalMs) / 1_000);
    values.push(curve[i] * factor);
  };
  for (let start = first; start <= last; start += size) {
    const end = Math.min(start + size, last + 1);
    let low = Math.floor(start);
    let high = low;
    for (let i = low; i < end; i++) {
      if (curve[i] < curve[low]) low = i;
      if (curve[i] > curve[high]) high = i;
    }
    put(Math.min(low, high));
    if (low !== high) put(Math.max(low, high));
  }
  return [times, values];
}

export class Charts {
  #plots = [];
  #data;
  #onTime;

  /// `onTime` is called with the time, in ms, at which the user has clicked.
  constructor(onTime) {
    this.#onTime = onTime;
    document.addEventListener('theme', () => this.#data && this.#make());
    new ResizeObserver(() => this.#resize()).observe(byId('charts'));
  }

  /// Shows the curves of a job.
  show(curves, intervalMs, ms) {
    this.#data = { curves, intervalMs, seconds: ms / 1_000 };
    byId('charts').hidden = false;
    this.#make();
  }

  #make() {
    this.#plots.forEach((plot) => plot.destroy());
    const { curves, seconds } = this.#data;
    const rows = [
      ['chart-v', curves.velocity, 60, 'mm/min'],
      ['chart-a', curves.acceleration, 1, 'mm/s²'],
      ['chart-j', curves.jerk, 1, 'mm/s³'],
    ];
    this.#plots = rows.map(([id, curve, factor, unit]) => this.#plot(byId(id), curve, factor, unit));
    this.#zoom(0, seconds);
  }

  #plot(place, curve, factor, unit) {
    const axis = { stroke: colour('quiet'), grid: { stroke: colour('line'), width: 1 }, ticks: { show: false }, font: '11px system-ui, sans-serif' };
    const plot = new window.uPlot(
      {
        width: Math.max(place.clientWidth, 200),
        height: HEIGHT,
        legend: { show: false },
        cursor: { sync: { key: 'job' }, drag: { x: true, y: false, setScale: false }, points: { show: false }, y: false },
        scales: { x: { time: false }, y: { range: (_, low, high) => (low === high ? [low - 1, high + 1] : [Math.min(low, 0), high * 1.06]) } },
        axes: [
          { ...axis, size: 22, values: (_, all) => all.map((s) => `${Number(s.toFixed(3))} s`) },
          { ...axis, size: 62, values: (_, all) => all.map((v) => v.toLocaleString('en').replaceAll(',', ' ')), splits: undefined, space: 30 },
        ],
        series: [{}, { label: unit, stroke: colour('accent'), width: 1.3, points: { show: false } }],
        hooks: { setSelect: [(plot) => this.#selected(plot)] },
      },
      [[], []],
      place,
    );
    plot.over.addEventListener('dblclick', () => this.#zoom(0, this.#data.seconds));
    plot.over.addEventListener('click', (event) => {
      if (this.#dragged) {
        this.#dragged = false;
        return;
      }
      this.#onTime(plot.posToVal(event.offsetX, 'x') * 1_000);
    });
    return Object.assign(plot, { curve, factor });
  }

  #dragged = false;

  #selected(plot) {
    const { left, width } = plot.select;
    if (width < 4) return;
    this.#dragged = true;
    this.#zoom(plot.posToVal(left, 'x'), plot.posToVal(left + width, 'x'));
  }

  #zoom(from, to) {
    const { intervalMs } = this.#data;
    for (const plot of this.#plots) {
      plot.setData(binned(plot.curve, intervalMs, from, to, plot.factor), false);
      plot.setSelect({ left: 0, width: 0, top: 0, height: 0 }, false);
      plot.batch(() => {
        plot.setScale('x', { min: from, max: Math.max(to, from + 0.001) });
      });
      plot.redraw(true, true);
    }
  }

  /// Moves the cursor to a time, ms.
  at(ms) {
    for (const plot of this.#plots) plot.setCursor({ left: plot.valToPos(ms / 1_000, 'x'), top: -10 }, false);
  }

  #resize() {
    for (const plot of this.#plots) {
      const width = plot.root.parentElement.clientWidth;
      if (width > 0 && width !== plot.width) plot.setSize({ width, height: HEIGHT });
    }
  }
}
