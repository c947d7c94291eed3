// The panel of the connected machine: position and state, stop and resume, overrides, jogging, switches, spindle, and a
// terminal.
//
// Owned by main.js, and used for a simulated machine and for a real one. Only a simulated machine has switches to
// press. Positions and the state are those that the machine reports (`sr`). Steps are those at a simulated machine's
// pins. Keys jog only while the jog buttons have the focus.

import { CardPanel } from './card-panel.js';
import { INPUTS } from './firmware.js';
import { STATES, parse } from './protocol.js';
import { byId, grouped, h, say } from './dom.js';

/// Number of lines that the terminal keeps.
const KEPT = 600;
/// Real-time characters.
const FLUSH = '!%';
const END = '\x04';
const RESET = '\x18';
/// Pulses of the encoder in a turn; `spn` is set to this value.
const PULSES = 16;
const SPINDLE = 1;
const SPEEDS = [['1', 'real time'], ['10', '10 times'], ['100', '100 times'], ['Infinity', 'as fast as it goes']];
const DIALECTS = [['tinyg', 'TinyG'], ['grbl', 'grbl 1.1']];
/// How often a machine in grbl's dialect is asked for its state, ms. In TinyG's dialect the machine reports it unasked.
const POLL_MS = 200;
const SWITCHES = [[0, 'X min'], [1, 'X max'], [2, 'Y min'], [3, 'Y max'], [4, 'Z min'], [5, 'Z max'], [8, 'Probe'], [9, 'Door'], [10, 'Emergency stop']];

export class MachinePanel {
  #board;
  #position = {};
  #state = 0;
  #hardware;
  #poll;
  #stalled = false;
  #turns = 0;
  #log = [];
  #history = [];
  #back = 0;

  /// `context` has `codes`, `machines`, `job()`, `onState(state)`.
  constructor(pane, context) {
    this.context = context;
    this.card = new CardPanel(context);
    const field = (id, name, control) => h('div', { class: 'field' }, h('label', { for: id }, name), control);
    this.dro = Object.fromEntries(['x', 'y', 'z'].map((axis) => [axis, h('dd', { id: `dro-${axis}` }, '0.000')]));
    this.velocity = h('dd', { id: 'dro-vel' }, '0');
    this.stateText = h('dd', { id: 'dro-state' }, '');
    this.clock = h('dd', { id: 'dro-steps' }, '');
    const cell = (name, value) => h('div', {}, h('dt', {}, name), value);
    this.speed = h('select', { id: 'speed' }, ...SPEEDS.map(([value, name]) => h('option', { value }, name)));
    this.speed.addEventListener('change', () => (this.#board.speed = Number(this.speed.value)));
    this.job = h('div', { hidden: true }, h('progress', { id: 'job-progress', max: 1, value: 0, 'aria-label': 'Progress of the job' }), h('p', { class: 'filename', id: 'job-text' }));
    const act = (name, text, hint, look) => h('button', { type: 'button', class: look, title: hint, id: `do-${name.toLowerCase().replaceAll(' ', '-')}`, onclick: () => this.#act(text) }, name);
    pane.append(
      h('dl', { class: 'dro' }, ...Object.entries(this.dro).map(([axis, value]) => cell(`${axis.toUpperCase()}, work`, value)), cell('mm/min', this.velocity), cell('state', this.stateText), cell('steps X Y Z', this.clock)),
      this.job,
      h('div', { class: 'buttons' },
        act('Hold', '!', 'Slows down and stands still (!)'),
        act('Resume', '~', 'Goes on (~)', 'primary'),
        act('Flush', FLUSH, 'Drops what is queued (!%)'),
        act('End', END, 'Ends the program (^d)'),
        act('Clear alarm', '{clear:n}\n', 'Ends an alarm'),
        act('Reset', RESET, 'Starts the board anew (^x): the position is lost', 'danger')),
      h('div', {}, h('h2', {}, 'Overrides'), h('div', { class: 'over' }, ...this.#override('Feed', 'mfo', 10, 200), ...this.#override('Rapid', 'mto', 10, 100), ...this.#override('Spindle', 'sso', 10, 200))),
      this.#jogging(),
      this.card.view,
      this.#simulation(field));
    byId('talk').append(this.#terminal());
  }

  #override(name, setting, min, max) {
    const id = `over-${setting}`;
    const shown = h('output', { for: id, id: `${id}-is` }, '100 %');
    const slider = h('input', { type: 'range', id, min, max, step: 5, value: 100 });
    slider.addEventListener('input', () => (shown.textContent = `${slider.value} %`));
    slider.addEventListener('change', () => this.#change(setting, Number(slider.value)));
    return [h('label', { for: id }, name), slider, shown];
  }

  /// In grbl's dialect overrides are characters that act at once: feed and spindle from 100 % in steps of 10 and 1,
  /// rapids 100, 50 and 25 %.
  #change(setting, percent) {
    if (this.#board.dialect === 'tinyg') return this.#board.type(`{${setting}:${percent / 100}}`);
    if (setting === 'mto') return this.#board.send(percent > 75 ? '\x95' : percent > 37 ? '\x96' : '\x97');
    const first = setting === 'mfo' ? 0x90 : 0x99;
    const [tens, ones] = [Math.trunc((percent - 100) / 10), (percent - 100) % 10];
    const times = (count, up) => String.fromCharCode(first + (count > 0 ? up : up + 1)).repeat(Math.abs(count));
    this.#board.send(String.fromCharCode(first) + times(tens, 1) + times(ones, 3));
  }

  #jogging() {
    this.step = h('select', { id: 'jog-step', 'aria-label': 'Distance of a jog' }, ...['0.1', '1', '10', '50'].map((mm) => h('option', { value: mm, selected: mm === '1' }, `${mm} mm`)));
    const jog = (text, label, axis, sign) => h('button', { type: 'button', 'aria-label': label, onclick: () => this.jog(axis, sign) }, text);
    const line = (text, ...lines) => h('button', { type: 'button', onclick: () => lines.forEach((line) => this.#board.type(line)) }, text);
    const pad = h('div', { class: 'jog', role: 'group', id: 'jog', 'aria-label': 'Jog: arrow keys move X and Y, page up and page down Z' },
      jog('X−', 'Jog X down', 'x', -1), jog('X+', 'Jog X up', 'x', 1), this.step, jog('Y−', 'Jog Y down', 'y', -1), jog('Y+', 'Jog Y up', 'y', 1),
      jog('Z−', 'Jog Z down', 'z', -1), jog('Z+', 'Jog Z up', 'z', 1), line('Zero', 'G10 L20 P1 X0 Y0 Z0'), h('button', { type: 'button', onclick: () => this.#board.type(this.#board.dialect === 'grbl' ? '$H' : '{home:1}') }, 'Home'), line('Probe Z', 'G91 G38.2 Z-50 F100', 'G90'));
    const keys = { ArrowLeft: ['x', -1], ArrowRight: ['x', 1], ArrowDown: ['y', -1], ArrowUp: ['y', 1], PageDown: ['z', -1], PageUp: ['z', 1] };
    pad.addEventListener('keydown', (event) => {
      const key = keys[event.key];
      if (!key || event.target === this.step) return;
      event.preventDefault();
      this.jog(...key);
    });
    return h('div', {}, h('h2', {}, 'Jog'), pad, h('p', { class: 'hint' }, 'With the focus on one of these buttons, the arrow keys move X and Y, page up and down Z.'));
  }

  #simulation(field) {
    const profile = h('select', { id: 'profile' }, ...this.context.machines.map(({ name, about }, n) => h('option', { value: n }, `${name}: ${about}`)));
    profile.addEventListener('change', () => this.#become(profile.value));
    this.profile = profile;
    const contact = ([input, name]) => h('button', { type: 'button', 'aria-pressed': 'false', 'data-input': input, onclick: ({ currentTarget: button }) => {
      const closed = button.getAttribute('aria-pressed') !== 'true';
      button.setAttribute('aria-pressed', String(closed));
      this.#board.press(input, closed);
    } }, name);
    this.contacts = h('div', { class: 'buttons', id: 'contacts' }, ...SWITCHES.map(contact));
    this.outputs = h('p', { class: 'filename', id: 'outputs' }, 'Outputs: none');
    this.stall = h('button', { type: 'button', id: 'stall', 'aria-pressed': 'false', onclick: () => this.#stallSpindle() }, 'Stall the spindle');
    this.simulated = h('div', { class: 'settings' },
      h('h2', {}, 'The simulated machine'),
      h('div', { class: 'row' }, field('speed', 'Runs at', this.speed), field('profile', 'Profile', profile)),
      h('h3', {}, 'Switches: press and release'), this.contacts,
      h('p', { class: 'hint' }, 'Both ends of an axis share a pin on this board. Motors work homing switches 5 mm beyond the start, and the probe at Z -20.'),
      h('h3', {}, 'Spindle'), this.outputs,
      h('div', { class: 'buttons' }, h('button', { type: 'button', id: 'encoder', onclick: () => this.#board.type(`{spn:${PULSES}}`) }, `Fit an encoder of ${PULSES} pulses`), this.stall));
    return this.simulated;
  }

  #terminal() {
    this.log = h('div', { class: 'log', id: 'log', role: 'log', tabindex: 0, 'aria-label': 'What was sent and heard' });
    this.input = h('input', { id: 'line', placeholder: 'g1 x10 f500, {xvm:n}, $$, ?', autocomplete: 'off', autocapitalize: 'off', spellcheck: 'false', 'aria-label': 'A line to send' });
    this.reports = h('input', { type: 'checkbox', id: 'reports' });
    this.dialect = h('select', { id: 'dialect' }, ...DIALECTS.map(([value, name]) => h('option', { value }, name)));
    this.dialect.addEventListener('change', () => this.#speak(this.dialect.value));
    this.input.addEventListener('keydown', (event) => this.#key(event));
    const form = h('form', {}, this.input, h('button', { type: 'submit' }, 'Send'));
    form.addEventListener('submit', (event) => {
      event.preventDefault();
      this.#typed(this.input.value);
      this.input.value = '';
    });
    return h('div', { class: 'settings' },
      h('div', { class: 'row terminal-head' }, h('h2', {}, 'Terminal'), h('label', { for: 'dialect' }, 'Dialect'), this.dialect, h('label', { class: 'check' }, this.reports, 'status reports')),
      h('div', { class: 'terminal' }, this.log, form));
  }

  #key(event) {
    const move = { ArrowUp: 1, ArrowDown: -1 }[event.key];
    if (!move) return;
    event.preventDefault();
    this.#back = Math.min(Math.max(this.#back + move, 0), this.#history.length);
    this.input.value = this.#back > 0 ? this.#history[this.#history.length - this.#back] : '';
  }

  #typed(line) {
    if (line !== '') this.#history.push(line);
    this.#back = 0;
    const character = { '^d': END, '^x': RESET, '^e': '\x05' }[line];
    if (character || /^[!~?]%?$/.test(line)) {
      this.#write('out', line);
      this.#board.send(character ?? (line === '?' ? '?\n' : line));
    } else {
      this.#board.type(line);
    }
  }

  #act(text) {
    if (text === '{clear:n}\n') this.#board.type(this.#board.dialect === 'grbl' ? '$X' : text.trim());
    else this.#board.send(text);
    if (text === FLUSH || text === END) this.#board.stopStream();
  }

  /// The first line after a start decides the dialect, so the machine is restarted.
  #speak(dialect) {
    this.#board.dialect = dialect;
    if (this.#board.simulated) this.#board.power();
    else this.#board.send(RESET);
  }

  /// Selects another profile, and restarts the machine. After the restart the motors actuate the switches at the places
  /// of the new profile.
  async #become(machine) {
    this.#board.type(`{mch:${machine}}`);
    await this.#stored();
    this.#board.send(RESET);
    say('The machine has another profile, and starts anew.');
  }

  async #stored() {
    if (this.#board.simulated) await this.#board.eeprom();
    else await new Promise((resolve) => setTimeout(resolve, 1_500));
  }

  /// Jogs an axis by the chosen distance from its present position. Does nothing while the axis moves.
  async jog(axis, sign) {
    if (this.#board.dialect === 'grbl') return this.#board.type(`$J=G91 G21 ${axis.toUpperCase()}${sign * Number(this.step.value)} F600`);
    try {
      const { body } = await this.#board.ask(`{mpo${axis}:n}`);
      const place = body[`mpo${axis}`] + sign * Number(this.step.value);
      this.#board.type(`{jog${axis}:${place.toFixed(3)}}`);
    } catch (error) {
      this.#write('error', error.message);
    }
  }

  /// Connects the panel to this board.
  use(board) {
    this.#board = board;
    this.card.use(board);
    this.simulated.hidden = !board.simulated;
    board.on('line', ({ line, asked }) => this.#heard(line, asked));
    board.on('sent', (line) => this.#write('out', line));
    board.on('state', (state) => this.#hardwareIs(state));
    board.on('booted', () => this.#booted());
    board.on('progress', ({ sent, total }) => this.#progress(sent, total));
    board.on('streamed', (streamed) => this.#streamed(streamed));
    if (board.simulated) board.speed = Number(this.speed.value);
    this.dialect.value = board.dialect;
    clearInterval(this.#poll);
    this.#poll = setInterval(() => board.dialect === 'grbl' && board.send('?'), POLL_MS);
  }

  async #booted() {
    for (const button of this.contacts.children) button.setAttribute('aria-pressed', 'false');
    for (const setting of ['mfo', 'mto', 'sso']) {
      byId(`over-${setting}`).value = 100;
      byId(`over-${setting}-is`).textContent = '100 %';
    }
    if (!this.#board.simulated) return;
    this.#turns = 0;
    this.context.onBoot();
  }

  /// Sets where the motors of a simulated machine actuate its switches, by the steps in a mm of each axis.
  wire(stepsPerMm) {
    const [x, y, z] = stepsPerMm;
    if (x) this.#board.near(INPUTS.indexOf('xmin'), Math.round(-5 * x));
    if (y) this.#board.near(INPUTS.indexOf('ymin'), Math.round(-5 * y));
    if (z) this.#board.near(INPUTS.indexOf('zmax'), Math.round(5 * z));
    if (z) this.#board.near(INPUTS.indexOf('probe'), Math.round(-20 * z));
  }

  /// Sends a job to the machine.
  stream(job) {
    if (this.#board.streaming) return say('A job is being sent already.');
    this.#write('out', `(job ${job.name})`);
    this.job.hidden = false;
    this.#progress(0, 1);
    this.#board.stream(job.text).catch((error) => {
      byId('job-text').textContent = `Not sent: ${error.message}. {ej:1,jv:3} has the machine answer each line.`;
    });
  }

  #progress(sent, total) {
    byId('job-progress').value = sent / Math.max(total, 1);
    byId('job-text').textContent = `line ${grouped(sent)} of ${grouped(total)}`;
  }

  #streamed({ answered, refused, why }) {
    byId('job-progress').value = 1;
    const end = why ? `The job has ended early: ${why}.` : 'All lines are with the machine.';
    byId('job-text').textContent = `${end} ${grouped(answered)} answered, ${refused.length} refused.`;
    for (const { line, text, status } of refused.slice(0, 50)) this.#write('error', `line ${line}: ${status} ${this.context.codes.get(status)?.text ?? ''}: ${text}`);
    say(byId('job-text').textContent);
  }

  #heard(line, asked) {
    const json = parse(line);
    const report = json?.sr ?? json?.r?.sr;
    if (report) this.#report(report);
    const grbl = /^<(\w+)[^>]*?(?:MPos|WPos):([-\d.,]+)/.exec(line);
    if (grbl) this.#grbl(grbl);
    const reports = (json?.sr || json?.qr || grbl) && !this.reports.checked;
    const answers = this.#board.streaming && json?.r && json.f?.[1] === 0 && Object.keys(json.r).length === 0;
    if (!asked && !reports && !answers) this.#write(json?.er || json?.f?.[1] > 0 || line.startsWith('error') ? 'error' : 'in', line);
  }

  #grbl([, state, places]) {
    const [posx, posy, posz] = places.split(',').map(Number);
    this.#report({ posx, posy, posz });
    this.stateText.textContent = state;
  }

  #report(report) {
    for (const axis of ['x', 'y', 'z']) if (`pos${axis}` in report) this.dro[axis].textContent = report[`pos${axis}`].toFixed(3);
    if ('vel' in report) this.velocity.textContent = grouped(report.vel);
    if ('stat' in report) this.#is(report.stat);
  }

  #is(stat) {
    this.#state = stat;
    this.stateText.textContent = STATES[stat] ?? String(stat);
    this.context.onState(stat);
  }

  #hardwareIs(state) {
    this.clock.textContent = state.steps.slice(0, 3).join(' ');
    const on = ['spindle', 'counter-clockwise', 'mist', 'flood'].filter((_, bit) => state.outputs & (1 << bit));
    const pulse = state.outputs & SPINDLE ? `, pulse ${(state.pulse / 10).toFixed(1)} %` : '';
    this.outputs.textContent = `Outputs: ${on.join(', ') || 'none'}${pulse}`;
    this.#hardware = state;
    this.#turn(state);
  }

  /// The spindle follows its output, 24,000 turns a minute at 100 %, unless it is stalled.
  #turn(state) {
    const rpm = state.outputs & SPINDLE && !this.#stalled ? (state.pulse / 1_000) * 24_000 : 0;
    if (rpm === this.#turns) return;
    this.#turns = rpm;
    this.#board.turnSpindle(rpm, PULSES);
  }

  #stallSpindle() {
    this.#stalled = !this.#stalled;
    this.stall.setAttribute('aria-pressed', String(this.#stalled));
    if (this.#hardware) this.#turn(this.#hardware);
  }

  #write(kind, text) {
    const bottom = this.log.scrollHeight - this.log.scrollTop - this.log.clientHeight < 40;
    this.log.append(h('div', { class: kind }, kind === 'out' ? `> ${text}` : text));
    while (this.log.children.length > KEPT) this.log.firstChild.remove();
    if (bottom) this.log.scrollTop = this.log.scrollHeight;
  }
}
