// The panel of a job: the file, the progress, and the results.
//
// Owned by main.js, which passes the machine whose settings the run uses. The run is in a Worker of its own, so that
// the page stays usable. Each job has a new Worker, so that a job that is cancelled can be ended even if it does not
// react.

import { byId, clock, grouped, h, millimetres, say } from './dom.js';

const EXAMPLES = [
  ['bracket.gcode', 'Bracket: outline, pockets, slots, holes'],
  ['square.gcode', 'Square: the smallest thing that moves'],
  ['spiral.gcode', 'Spiral: 2,000 segments of 0.1 mm'],
  ['engraving.gcode', 'Engraving: short moves at low speed'],
];
/// Number of refusals and notes that are shown; the others are only counted.
const SHOWN = 200;
const LIMITS = { short: (least) => `A move takes at least 0.75 ms: the shortest goes at ${least}` };

export class JobPanel {
  /// The job: `{ name, text }`; `undefined` if there is none yet.
  job;
  #worker;
  #began = 0;
  #run = 0;

  /// `context` has `module`, `board()`, `codes` and `onResult(result)`.
  constructor(pane, context) {
    this.context = context;
    this.file = h('input', { type: 'file', id: 'file', accept: '.gcode,.nc,.ngc,.tap,.txt,.cnc,.gc', class: 'visually-hidden', tabindex: -1, 'aria-label': 'G-code file' });
    this.file.addEventListener('change', () => this.open(this.file.files[0]));
    this.examples = h('select', { id: 'example' }, h('option', { value: '' }, 'Choose an example'), ...EXAMPLES.map(([file, name]) => h('option', { value: file }, name)));
    this.examples.addEventListener('change', () => this.examples.value && this.example(this.examples.value));
    this.name = h('p', { class: 'filename', id: 'job-name' }, 'No job yet');
    this.zero = ['X', 'Y', 'Z'].map((axis) => h('input', { type: 'number', step: 'any', placeholder: 'auto', 'aria-label': `Work zero ${axis} in machine coordinates, mm` }));
    this.run = h('button', { class: 'primary', id: 'run', type: 'button', disabled: true, onclick: () => this.start() }, 'Run again');
    this.cancel = h('button', { id: 'cancel', type: 'button', hidden: true, onclick: () => this.stop() }, 'Cancel');
    this.send = h('button', { id: 'send-job', type: 'button', disabled: true, onclick: () => context.sendJob(this.job) }, 'Send to the machine');
    this.progress = h('progress', { id: 'progress', max: 1, value: 0, 'aria-label': 'Progress of the run' });
    this.progressText = h('span', { class: 'filename' });
    this.busy = h('div', { hidden: true }, this.progress, this.progressText);
    this.result = h('div', { id: 'result', class: 'settings' });
    pane.append(
      h('div', { class: 'settings' },
        h('div', { class: 'field' }, h('label', { for: 'example' }, 'Job'), this.examples),
        h('div', { class: 'row' }, h('button', { type: 'button', onclick: () => this.file.click() }, 'Open a file…'), this.file, this.name),
        h('details', {}, h('summary', {}, 'Work zero'),
          h('p', { class: 'hint' }, 'Where the zero of the job is in machine coordinates, mm. Empty: the lower ends of X and Y, the middle of Z.'),
          h('div', { class: 'grid3' }, ...this.zero)),
        h('div', { class: 'buttons' }, this.run, this.cancel, this.send),
        this.busy),
      this.result);
  }

  async example(file) {
    const answer = await fetch(`examples/${file}`);
    this.take(file, await answer.text());
  }

  async open(file) {
    if (!file) return;
    this.examples.value = '';
    this.take(file.name, await file.text());
    this.file.value = '';
  }

  /// Takes a new job, and runs it at once.
  take(name, text) {
    this.job = { name, text };
    this.name.textContent = `${name}, ${grouped(text.split('\n').length)} lines`;
    this.run.disabled = false;
    this.send.disabled = false;
    return this.start();
  }

  #zero() {
    const values = this.zero.map((input) => input.value.trim());
    return values.every((value) => value !== '') ? values.map(Number) : undefined;
  }

  async start() {
    if (!this.job) return;
    this.#worker?.terminate();
    this.#worker = undefined;
    const run = (this.#run += 1);
    this.#began = performance.now();
    this.#busy(true);
    const board = this.context.board();
    const eeprom = board?.simulated ? await board.eeprom() : new Uint8Array();
    const settings = board?.simulated ? [] : await this.context.settingsOfBoard();
    // The user has cancelled the run or started another one meanwhile.
    if (run !== this.#run) return;
    const worker = new Worker(new URL('./job-worker.js', import.meta.url), { type: 'module' });
    this.#worker = worker;
    worker.onmessage = ({ data }) => {
      if (worker !== this.#worker) return;
      if (data.progress) this.#told(data.progress);
      else this.#ended(data);
    };
    worker.onerror = (event) => this.#ended({ error: event.message || 'the run has failed' });
    const { text } = this.job;
    worker.postMessage({ module: this.context.module, job: { text, eeprom, settings, zero: this.#zero() } });
  }

  stop() {
    this.#run += 1;
    this.#worker?.terminate();
    this.#ended({ cancelled: true });
  }

  #busy(on) {
    this.busy.hidden = !on;
    this.cancel.hidden = !on;
    this.run.disabled = on;
    this.progress.value = 0;
    this.progressText.textContent = 'starting';
  }

  #told({ sent, total, ms }) {
    this.progress.value = total > 0 ? sent / total : 1;
    const speed = ms / Math.max(performance.now() - this.#began, 1);
    this.progressText.textContent = `line ${grouped(sent)} of ${grouped(total)}, ${clock(ms)} of machine time, ${speed.toFixed(0)} times real time`;
  }

  #ended({ result, cancelled, error }) {
    this.#busy(false);
    this.#worker?.terminate();
    this.#worker = undefined;
    if (error || cancelled) {
      const text = error ? `The run has failed: ${error}` : 'Cancelled.';
      this.result.replaceChildren(h('p', { class: `verdict ${error ? 'bad' : 'warn'}`, role: 'status' }, text));
      return;
    }
    this.#show(result);
    this.context.onResult(result, this.job.name);
  }

  #show(result) {
    const { ms, distance, extents, refused, lines } = result;
    let fastest = 0;
    for (const v of result.speed) fastest = Math.max(fastest, v);
    const outside = extents.filter((e) => e.lower !== e.upper && (e.from < e.lower - 0.01 || e.to > e.upper + 0.01));
    const bad = refused.length > 0 || outside.length > 0;
    const verdict = bad
      ? [refused.length > 0 && `${refused.length} of ${grouped(lines)} lines refused`, outside.length > 0 && 'beyond the travel'].filter(Boolean).join(', ')
      : `All ${grouped(lines)} lines carried out`;
    const fact = (name, value, id) => h('div', {}, h('dt', {}, name), h('dd', { id }, value));
    const row = (e) => h('tr', {}, ...[e.axis.toUpperCase(), ...[e.from, e.to, e.to - e.from, e.lower, e.upper].map((mm) => mm.toFixed(2))].map((text) => h('td', {}, text)));
    this.result.replaceChildren(
      h('p', { class: `verdict ${bad ? 'bad' : 'good'}`, id: 'verdict', role: 'status' }, verdict),
      h('dl', { class: 'facts' },
        fact('Duration', clock(ms), 'duration'), fact('Distance', millimetres(distance), 'distance'), fact('Fastest', `${grouped(fastest * 60)} mm/min`)),
      h('div', {}, h('h2', {}, 'How far it goes'),
        h('table', {}, h('thead', {}, h('tr', {}, ...['mm', 'from', 'to', 'size', 'min', 'max'].map((text) => h('th', { scope: 'col' }, text)))), h('tbody', { id: 'extents' }, ...extents.map(row)))),
      this.#findings(result, outside),
      h('p', { class: 'hint', id: 'took', 'data-steps': JSON.stringify(result.finalSteps), 'data-totals': JSON.stringify(result.totals), 'data-ms': ms, 'data-took': Math.round(result.tookMs), 'data-memory': result.memory },
        `Ran in ${(result.tookMs / 1_000).toFixed(1)} s, ${grouped(ms / result.tookMs)} times real time; ${(result.memory / 1e6).toFixed(0)} MB. Motors end at ${result.finalSteps.map((s) => String(s)).join(', ')} steps.`));
    say(`${verdict}. Duration ${clock(ms)}.`);
  }

  #findings(result, outside) {
    const items = [];
    for (const { line, text, status } of result.refused.slice(0, SHOWN)) {
      const code = this.context.codes.get(status);
      items.push(h('li', { class: 'refused' }, h('b', {}, `Line ${line}: ${status} ${code?.text ?? ''}`), h('code', {}, text), code?.cause && h('p', {}, `${code.cause} ${code.cure}`)));
    }
    for (const e of outside) items.push(h('li', { class: 'refused' }, h('b', {}, `${e.axis.toUpperCase()} goes beyond the travel`), h('p', {}, `${e.from.toFixed(2)} to ${e.to.toFixed(2)} mm, of ${e.lower.toFixed(2)} to ${e.upper.toFixed(2)} mm from the work zero.`)));
    for (const a of result.asked) {
      const place = a.first === a.last ? `Line ${a.first} asks` : `Lines ${a.first} to ${a.last} ask`;
      const least = `${grouped(a.allowed)} mm/min`;
      const why = LIMITS[a.limit]?.(least) ?? `${a.limit.toUpperCase()} allows as little as ${least} (settings ${a.limit}fr and ${a.limit}vm)`;
      items.push(h('li', {}, h('b', {}, `Slower than asked: ${grouped(a.lines)} ${a.lines === 1 ? 'line' : 'lines'}`), h('p', {}, `${place} for up to ${grouped(a.asked)} mm/min. ${why}.`)));
    }
    if (result.rushed) items.push(h('li', {}, h('b', {}, 'A board may take longer'), h('p', {}, `${result.busiest} lines in a second are about what a board can do: up to 8 % more time.`)));
    for (const { line, text, status } of result.notes.slice(0, SHOWN)) {
      const code = this.context.codes.get(status);
      items.push(h('li', {}, h('b', {}, `Line ${line}`), h('p', {}, [code && `${status} ${code.text}.`, text].filter(Boolean).join(' '))));
    }
    const more = Math.max(result.refused.length - SHOWN, 0) + Math.max(result.notes.length - SHOWN, 0);
    if (more > 0) items.push(h('li', {}, `and ${grouped(more)} more`));
    if (items.length === 0) return h('p', { class: 'hint' }, 'No line is refused, and no limit slows a feed.');
    return h('div', {}, h('h2', {}, 'What to know'), h('ul', { class: 'findings', id: 'findings', tabindex: 0, 'aria-label': 'What to know' }, ...items));
  }
}

/// Takes files that are dropped on the view.
export function takeDrops(onFile) {
  const drop = byId('drop');
  let depth = 0;
  const show = (on) => {
    drop.hidden = !on;
  };
  addEventListener('dragenter', (event) => {
    event.preventDefault();
    depth += 1;
    show(true);
  });
  addEventListener('dragover', (event) => event.preventDefault());
  addEventListener('dragleave', () => {
    depth -= 1;
    show(depth > 0);
  });
  addEventListener('drop', (event) => {
    event.preventDefault();
    depth = 0;
    show(false);
    onFile(event.dataTransfer.files[0]);
  });
}
