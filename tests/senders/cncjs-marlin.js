// CNCjs, its Marlin controller, through its own server: node cncjs-marlin.js PORT JOB

'use strict';

const fs = require('fs');
const Server = require('./cncjs-server');
const { step, sleep, until, ensure, main } = require('./steps');

const [port, job] = process.argv.slice(2);
const gcode = fs.readFileSync(job, 'utf8');
const server = new Server(port, 'Marlin');

const FAR = 40;

const pos = () => server.controller.pos || {};
const x = () => Number(pos().x);

/// The lines that come from the board from now on.
function hear() {
  const from = server.lines.length;
  return (start) => server.lines.slice(from).find((line) => line.startsWith(start));
}

async function ask(line, start) {
  const heard = hear();
  server.type(line);
  return until(() => heard(start));
}

/// Opens the port, which resets the board, as DTR does; CNCjs asks who is there.
async function connect() {
  await server.open();
  await until(() => (server.settings.firmwareName || '').startsWith('Kerf'));
  return server.settings.firmwareName;
}

async function settings() {
  for (const line of ['M92 X80 Y80 Z400 E93', 'M203 X150 Y150 Z10 E50', 'M201 X1000 Y1000 Z100 E5000', 'M500']) {
    await ask(line, 'ok');
  }
  return ask('M503', 'echo:  M92');
}

/// It asks by itself for temperatures and places.
async function polls() {
  const now = () => server.controller;
  await until(() => Number((now().extruder || {}).deg) > 0 && x() === 0);
  return `hot end ${now().extruder.deg}, bed ${now().heatedBed.deg}`;
}

async function jog() {
  for (const [line, end] of [['G1 X2 F3000', 2], ['G1 X-2 F3000', 0]]) {
    ['G91', line, 'G90'].forEach((text) => server.command('gcode', text));
    await until(() => x() === end);
  }
  return 'X by 2 mm and back';
}

/// Stops a program in the middle of a long move: what is queued goes on, M112 ends it.
async function stop() {
  await server.load('far', `G21 G90\nG1 X${FAR} F20\nG1 X${FAR + 1}\n`);
  server.command('gcode:start');
  // CNCjs ends a job by a G4, which is answered when the machine rests. Until then it asks nothing.
  await sleep(1000);
  server.command('gcode:stop', { force: true });
  await until(() => server.workflow === 'idle');
  const heard = hear();
  server.type('M112');
  await until(() => heard('Error:'));
  await sleep(1000);
  const there = x();
  await sleep(1000);
  ensure(there < FAR && there === x(), `at ${there}, then ${x()}`);
  server.type('M999');
  ['G90', 'G1 X0 F3000'].forEach((text) => server.command('gcode', text));
  await until(() => x() === 0);
  return `at X ${there} of ${FAR}, M999, back at 0`;
}

async function start() {
  await server.load(job, gcode);
  server.command('gcode:start');
  await until(() => server.workflow === 'running' && server.sender.total > 500);
  return `${server.sender.total} lines`;
}

/// Pauses: no further line is sent, and the machine comes to rest.
async function pause() {
  await until(() => server.answered > server.sender.total / 10);
  server.command('gcode:pause');
  await until(() => server.workflow === 'paused');
  // What is queued is carried out: 61 moves, for longer the slower the machine is simulated.
  const { answered } = server;
  const state = () => `line ${server.answered}, ${JSON.stringify(pos())}`;
  let before;
  do {
    before = state();
    await sleep(1500);
  } while (state() !== before);
  const waits = server.answered;
  ensure(waits - answered < 100 && server.workflow === 'paused', `it goes on: ${state()}`);
  server.command('gcode:resume');
  await until(() => server.answered > waits);
  return `stood at line ${waits}, goes on`;
}

async function finish() {
  await until(() => server.workflow === 'idle');
  const { total } = server.sender;
  ensure(server.answered === total, `answered ${server.answered} of ${total}`);
  const wrong = server.lines.find((line) => /^(Error|echo:Unknown)/.test(line) && !/stopped/.test(line));
  ensure(!wrong, wrong);
  // A poll's answer begins with ok as M400's does; M118 has a text of its own and waits behind it.
  server.type('M400');
  await ask('M118 all printed', 'all printed');
  return `${total} of ${total} lines answered, at ${Object.values(pos()).join(' ')}`;
}

main(async () => {
  await step('start', 60, () => server.start());
  await step('connect', 20, connect);
  await step('settings', 20, settings);
  await step('polls', 20, polls);
  await step('jog', 60, jog);
  await step('stop', 60, stop);
  await step('stream', 20, start);
  await step('pause', 120, pause);
  await step('finish', 600, finish);
  await step('close', 20, () => server.close());
}, () => server.stop());
