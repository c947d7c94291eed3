// Puts the page together: loads the firmware, boots a machine in a Worker, and connects the panels to the view.
//
// | module | owns |
// |---|---|
// | `boards.js` | the connected machine, simulated or real |
// | `job-panel.js` | a job and its dry run in `job-worker.js` |
// | `machine-panel.js`, `card-panel.js` | controls and terminal; the files of its SD card |
// | `verify-panel.js`, `verify.js` | the checks of a real board |
// | `settings-panel.js`, `settings-file.js` | settings as a form and as a file |
// | `view.js`, `charts.js`, `bins.js` | path and curves |
// | `firmware.js`, `sender.js`, `protocol.js`, `path.js`, `job-run.js` | run in Workers, and in Node for tests |

import { SerialBoard, SimulatedBoard } from './boards.js';
import { Charts } from './charts.js';
import { byId, clock, grouped, say } from './dom.js';
import { Firmware } from './firmware.js';
import { JobPanel, takeDrops } from './job-panel.js';
import { MachinePanel } from './machine-panel.js';
import { STATES } from './protocol.js';
import { requests, save } from './settings-file.js';
import { SettingsPanel } from './settings-panel.js';
import { startTheme } from './theme.js';
import { VerifyPanel } from './verify-panel.js';
import { View } from './view.js';

const page = { board: undefined, result: undefined, ms: 0, playing: false, scale: undefined };

/// Reads the geometry of the machine: steps in a mm of X, Y and Z, their motors, and the ends of travel.
async function readMachine(board) {
  const motors = [];
  for (const m of [1, 2, 3, 4]) motors.push((await board.ask(`{${m}:n}`)).body[m]);
  const axes = [];
  for (const axis of ['x', 'y', 'z']) axes.push((await board.ask(`{${axis}:n}`)).body[axis]);
  const motorOf = [0, 1, 2].map((axis) => motors.findIndex((motor) => motor.ma === axis));
  const perMm = motorOf.map((m) => (m < 0 ? 0 : (360 * motors[m].mi) / (motors[m].tr * motors[m].sa)));
  return { motorOf, perMm, axes };
}

function placeOf(steps, offset = 0) {
  const { motorOf, perMm } = page.machine;
  return motorOf.map((m, axis) => (m < 0 || perMm[axis] === 0 ? 0 : steps[offset + m] / perMm[axis]));
}

/// Called when the machine has booted. Wires its switches, and shows its travel in the view.
async function booted(board, panel) {
  try {
    if (board.dialect === 'grbl') {
      board.send('?');
      panel.wire(page.machine.perMm);
      return;
    }
    await board.ask('{sr:n}');
    page.machine = await readMachine(board);
    panel.wire(page.machine.perMm);
    panel.profile.value = (await board.ask('{mch:n}')).body.mch;
    if (!page.result) showTravel();
    page.view.clearTrail();
    await settings.show();
  } catch (error) {
    // The machine was reset meanwhile. The next boot asks again.
    console.info(error.message);
  }
}

function showTravel() {
  const { axes } = page.machine;
  page.view.limits(axes.map((axis) => axis.tn), axes.map((axis) => axis.tm));
}

/// Shows a time of the job: tool, curves, numbers.
function go(ms) {
  const { result } = page;
  if (!result) return;
  page.ms = Math.min(Math.max(ms, 0), result.ms);
  const last = result.steps.length / 4 - 1;
  const sample = Math.min(Math.round(page.ms / result.intervalMs), last);
  const place = result.drawn.map((axis) => (axis ? result.steps[4 * sample + axis.motor] * axis.scale : 0));
  page.view.at(place, sample);
  page.charts.at(page.ms);
  byId('scrub').value = page.ms;
  byId('scrub').setAttribute('aria-valuetext', clock(page.ms));
  byId('clock').textContent = clock(page.ms);
  ['x', 'y', 'z'].forEach((axis, n) => (byId(`at-${axis}`).textContent = place[n].toFixed(3)));
  byId('at-v').textContent = grouped(result.speed[sample] * 60);
}

/// Plays the job in 20 seconds, or at real time if it takes less.
function play(on) {
  page.playing = on;
  byId('play').textContent = on ? '❚❚' : '▶';
  byId('play').setAttribute('aria-label', on ? 'Pause' : 'Play');
  if (!on) return;
  if (page.ms >= page.result.ms) page.ms = 0;
  let last = performance.now();
  const rate = Math.max(page.result.ms / 20_000, 1);
  const frame = (now) => {
    if (!page.playing) return;
    go(page.ms + (now - last) * rate);
    last = now;
    if (page.ms >= page.result.ms) play(false);
    else requestAnimationFrame(frame);
  };
  requestAnimationFrame(frame);
}

function showResult(result, name) {
  page.result = result;
  play(false);
  let fastest = 1e-6;
  for (const v of result.speed) fastest = Math.max(fastest, v);
  for (const id of ['timebar', 'readout', 'legend']) byId(id).hidden = false;
  byId('empty').hidden = true;
  byId('legend-max').textContent = grouped(fastest * 60);
  byId('scrub').max = result.ms;
  byId('canvas').setAttribute('aria-label', `Path of ${name} in 3D, coloured by speed; it takes ${clock(result.ms)}`);
  const limits = ['x', 'y', 'z'].map((axis) => result.extents.find((extent) => extent.axis === axis));
  page.view.limits(limits.map((extent) => extent?.lower ?? 0), limits.map((extent) => extent?.upper ?? 0), result.systems);
  page.charts.show(result);
  page.view.show(result.path, result.speed, fastest);
  go(result.ms);
}

function showTab(name) {
  for (const tab of ['job', 'machine', 'settings']) {
    const on = tab === name;
    byId(`pane-${tab}`).hidden = !on;
    byId(`tab-${tab}`).setAttribute('aria-selected', String(on));
    byId(`tab-${tab}`).tabIndex = on ? 0 : -1;
  }
  const job = name === 'job' && Boolean(page.result);
  for (const id of ['timebar', 'readout', 'legend', 'charts']) byId(id).hidden = !job;
  page.view.showJob(name === 'job');
  if (name === 'job' && page.result) go(page.ms);
  if (name !== 'job' && page.steps && page.machine) page.view.at(placeOf(page.steps));
  byId('talk').hidden = name === 'job';
  byId('empty').hidden = name !== 'job' || Boolean(page.result);
  page.tab = name;
}

function startTabs() {
  const tabs = ['job', 'machine', 'settings'];
  for (const tab of tabs) {
    byId(`tab-${tab}`).addEventListener('click', () => showTab(tab));
    byId(`tab-${tab}`).addEventListener('keydown', (event) => {
      const move = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
      if (!move) return;
      const next = tabs[(tabs.indexOf(tab) + move + tabs.length) % tabs.length];
      showTab(next);
      byId(`tab-${next}`).focus();
    });
  }
}

function showLink(text, look = '') {
  const pill = byId('link-state');
  pill.textContent = text;
  pill.className = `pill ${look}`;
}

let settings;

function use(board, machinePanel) {
  page.board = board;
  board.on('state', (state) => {
    page.steps = state.steps;
  });
  board.on('trail', (trail) => {
    if (!page.machine || page.tab === 'job') return;
    const places = [];
    for (let i = 0; i < trail.length; i += 4) places.push(...placeOf(trail, i));
    page.view.follow(places);
  });
  machinePanel.use(board);
  settings.use(board);
}

/// Asks a real board for its state and settings. A board that does not answer can be checked, too.
async function greet(board) {
  try {
    await board.ask('{sr:n}');
    await settings.show();
  } catch {
    if (page.board === board) showLink('No answer', 'bad');
  }
  byId('check').hidden = page.board !== board;
}

/// Replaces the simulated board by a real one, or the other way round.
async function connect(machinePanel, module) {
  if (!page.board.simulated) {
    await page.board.close();
    return;
  }
  try {
    const board = await SerialBoard.open();
    page.board.close();
    use(board, machinePanel);
    byId('connect').textContent = 'Disconnect';
    showLink('Real board');
    showTab('machine');
    board.on('closed', () => {
      byId('connect').textContent = 'Connect a board';
      byId('check').hidden = true;
      say('The port is closed.');
      use(new SimulatedBoard(module), machinePanel);
    });
    // A board resets and sends its greeting when its port is opened.
    setTimeout(() => greet(board), 2_500);
  } catch (error) {
    if (error.name !== 'NotFoundError') say(`The port cannot be opened: ${error.message}`);
  }
}

async function start() {
  startTheme();
  const [module, schema] = await Promise.all([
    WebAssembly.compileStreaming(fetch('kerf.wasm')),
    fetch('settings.schema.json').then((answer) => answer.json()),
  ]);
  const tables = new Firmware(module).tables();
  const codes = new Map(tables.codes.map((code) => [code.code, code]));
  byId('about').textContent = `the firmware ${tables.version}, running in this page`;
  page.view = new View(byId('canvas'));
  page.charts = new Charts((ms) => {
    play(false);
    go(ms);
  });
  settings = new SettingsPanel(byId('pane-settings'), schema, codes);
  const machinePanel = new MachinePanel(byId('pane-machine'), {
    codes,
    machines: tables.machines,
    job: () => jobPanel.job,
    onState: (stat) => showLink(`${page.board.name}: ${STATES[stat] ?? stat}`, { 2: 'bad', 11: 'bad', 13: 'bad', 6: 'warn' }[stat]),
    onBoot: () => booted(page.board, machinePanel),
  });
  const jobPanel = new JobPanel(byId('pane-job'), {
    module,
    codes,
    board: () => page.board,
    settingsOfBoard: async () => requests(await save(page.board)).filter((line) => !/^\{(sr|ej|dia)/.test(line)),
    onResult: showResult,
    sendJob: (job) => {
      showTab('machine');
      machinePanel.stream(job);
    },
  });
  takeDrops((file) => {
    showTab('job');
    jobPanel.open(file);
  });
  startTabs();
  for (const button of document.querySelectorAll('[data-view]')) button.addEventListener('click', () => page.view.look(button.dataset.view));
  byId('scrub').addEventListener('input', (event) => {
    play(false);
    go(Number(event.target.value));
  });
  byId('play').addEventListener('click', () => play(!page.playing));
  new VerifyPanel({ module, board: () => page.board });
  byId('connect').hidden = !('serial' in navigator);
  byId('connect').addEventListener('click', () => connect(machinePanel, module));
  use(new SimulatedBoard(module), machinePanel);
  showTab('job');
  document.documentElement.dataset.ready = 'true';
}

start().catch((error) => {
  byId('empty').textContent = `The page cannot start: ${error.message}`;
  console.error(error);
});
