// Charts of velocity, acceleration and jerk of each axis over time, drawn by uPlot, with the limits of the axes as dashed
// lines. The three zoom together, and share a cursor with the time bar.
//
// Owned by main.js. `bins.js` makes the points of long curves, again at each zoom.

import { binned, range } from './bins.js';
import { byId, grouped, h } from './dom.js';
import { colour } from './theme.js';

const HEIGHT = 118;
const DASHES = [6, 4];

/// The charts: the place and the key of each, what it shows, and the factor of its unit.
const ROWS = [
  { place: 'chart-v', key: 'key-v', quantity: 'velocity', factor: 60 },
  { place: 'chart-a', key: 'key-a', quantity: 'acceleration', factor: 1 },
  { place: 'chart-j', key: 'key-j', quantity: 'jerk', factor: 1 },
];

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

  /// Shows the curves of the result of a job.
  show({ curves, intervalMs, windowMs, ms }) {
    this.#data = { curves, intervalMs, seconds: ms / 1_000 };
    byId('charts').hidden = false;
    byId('windows').textContent = `From the steps: acceleration from positions ${windowMs} ms apart, velocity and jerk ${2 * windowMs} ms. Dashed: limits.`;
    this.#make();
  }

  #make() {
    this.#plots.forEach((plot) => plot.destroy());
    this.#plots = ROWS.map((row) => this.#plot(row));
    this.#zoom(0, this.#data.seconds);
  }

  #plot({ place: id, key, quantity, factor }) {
    const { curves } = this.#data;
    const place = byId(id);
    const limits = curves.map((curve) => curve.limits[quantity] * factor);
    const colours = curves.map(({ axis }) => colour(`axis-${axis}`));
    byId(key).replaceChildren(...curves.map(({ axis }, n) => h('span', { class: `key key-${axis}` }, `${axis.toUpperCase()} ${Number.isFinite(limits[n]) ? `limit ${grouped(limits[n])}` : 'no limit'}`)));
    const axis = { stroke: colour('quiet'), grid: { stroke: colour('line'), width: 1 }, ticks: { show: false }, font: '11px system-ui, sans-serif' };
    const plot = new window.uPlot(
      {
        width: Math.max(place.clientWidth, 200),
        height: HEIGHT,
        legend: { show: false },
        cursor: { sync: { key: 'job' }, drag: { x: true, y: false, setScale: false }, points: { show: false }, y: false },
        scales: { x: { time: false }, y: { range: (_, low, high) => range(low ?? 0, high ?? 0, limits) } },
        axes: [
          { ...axis, size: 22, values: (_, all) => all.map((s) => `${Number(s.toFixed(3))} s`) },
          { ...axis, size: 62, values: (_, all) => all.map((v) => v.toLocaleString('en').replaceAll(',', ' ')), splits: undefined, space: 30 },
        ],
        series: [{}, ...curves.map(({ axis: label }, n) => ({ label, stroke: colours[n], width: 1.2, points: { show: false } }))],
        hooks: { setSelect: [(plot) => this.#selected(plot)], draw: [(plot) => drawLimits(plot, limits, colours)] },
      },
      [[], ...curves.map(() => [])],
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
    return Object.assign(plot, { curves: curves.map((curve) => curve[quantity]), factor });
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
      plot.setData(binned(plot.curves, intervalMs, from, to, plot.factor), false);
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

/// Draws the limits that are within the scale, each in the colour of its axis.
function drawLimits(plot, limits, colours) {
  const { ctx, bbox } = plot;
  const { min, max } = plot.scales.y;
  ctx.save();
  ctx.setLineDash(DASHES.map((dash) => dash * devicePixelRatio));
  ctx.lineWidth = devicePixelRatio;
  limits.forEach((limit, n) => {
    ctx.strokeStyle = colours[n];
    for (const level of [-limit, limit].filter((level) => level >= min && level <= max)) {
      const y = plot.valToPos(level, 'y', true);
      ctx.beginPath();
      ctx.moveTo(bbox.left, y);
      ctx.lineTo(bbox.left + bbox.width, y);
      ctx.stroke();
    }
  });
  ctx.restore();
}
