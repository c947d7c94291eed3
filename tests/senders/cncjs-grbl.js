// CNCjs, its Grbl controller, through its own server: node cncjs-grbl.js PORT JOB

'use strict';

const fs = require('fs');
const Server = require('./cncjs-server');
const { step, sleep, until, within, ensure, main } = require('./steps');

const [port, job] = process.argv.slice(2);
const gcode = fs.readFileSync(job, 'utf8');
const server = new Server(port, 'Grbl');

const FAR = 40;
/// Where the plate is when Z is homed, at its top.
const PLATE = -51.8;

const status = () => server.controller.status || {};
const state = () => status().activeState;
const x = () => Number((status().mpos || {}).x);
const z = () => Number((status().mpos || {}).z);

/// The lines that come from the board from now on.
function hear() {
  const from = server.lines.length;
  return (start) => server.lines.slice(from).find((line) => line.startsWith(start));
}

/// Opens the port, which resets the board, as DTR does; it finds its dialect by itself.
async function connect() {
  await server.open();
  await until(() => state() === 'Idle' && (server.settings.settings || {}).$110);
  await until(() => ((server.controller.parserstate || {}).modal || {}).motion);
  return `version ${server.settings.version}, ${Object.keys(server.settings.settings).length} settings`;
}

async function ask(line, start) {
  const heard = hear();
  server.type(line);
  // It explains settings behind a blank.
  return (await until(() => heard(start))).split(' ')[0];
}

async function settings() {
  const before = await ask('$$', '$110=');
  await ask('$110=700', 'ok');
  // Its own polling has answers, too.
  while ((await ask('$$', '$110=')) !== '$110=700.000') await sleep(50);
  await server.close();
  await connect();
  ensure((await ask('$$', '$110=')) === '$110=700.000', 'the new value is not kept');
  await ask(before, 'ok');
  while ((await ask('$$', '$110=')) !== before) await sleep(50);
  return `${before}, written 700, kept over a reset, written back`;
}

async function jog() {
  for (const [line, end] of [['$J=G91 X2 F600', 2], ['$J=G91 X-2 F600', 0]]) {
    server.type(line);
    await until(() => x() === end && state() === 'Idle');
  }
  return 'X by 2 mm and back';
}

/// Lets go of the button in the middle of a long jog.
async function cancel() {
  server.type(`$J=G91 X${FAR} F60`);
  await until(() => state() === 'Jog' && x() > 0);
  server.command('jogCancel');
  await until(() => state() === 'Idle');
  const there = x();
  ensure(there > 0 && there < FAR, `at ${there}`);
  server.command('gcode', 'G90');
  server.command('gcode', 'G0 X0');
  await until(() => x() === 0 && state() === 'Idle');
  return `at X ${there} of ${FAR}`;
}

async function overrides() {
  server.command('feedOverride', 10);
  server.command('rapidOverride', 50);
  server.command('spindleOverride', -10);
  await until(() => String((status().ov || []).join()) === '110,50,90');
  server.command('feedOverride', 0);
  server.command('rapidOverride', 100);
  server.command('spindleOverride', 0);
  await until(() => String((status().ov || []).join()) === '100,100,100');
  return '110, 50, 90 % and back';
}

async function home() {
  for (const axis of ['X', 'Y', 'Z']) await ask(`$H${axis}`, 'ok');
  await until(() => state() === 'Idle');
  const { x: at, y, z } = status().mpos;
  ensure([at, y, z].every((place) => Number(place) === 0), `at ${at} ${y} ${z}`);
  return `at ${at} ${y} ${z}`;
}

async function probe() {
  const heard = hear();
  server.command('gcode', 'G38.2 Z-70 F800');
  const result = await until(() => heard('[PRB:'));
  const [, , z] = result.slice(5).split(',').map(parseFloat);
  ensure(result.endsWith(':1]') && Math.abs(z - PLATE) < 0.01, result);
  return result;
}

/// Stops a program in the middle of a long move: a hold, and a reset in it.
async function stop() {
  await server.load('far', `G21 G90\nG1 X${FAR} F60\nM30\n`);
  server.command('gcode:start');
  await until(() => state() === 'Run' && x() > 0);
  const heard = hear();
  server.command('gcode:stop', { force: true });
  // It resets only if it has heard of the hold half a second later.
  if (!(await within(3000, () => heard('Grbl 1.1')))) server.command('reset');
  await until(() => heard('Grbl 1.1'));
  // Held at rest nothing was interrupted; else it is an alarm.
  await until(() => state() === 'Idle' || state() === 'Alarm');
  const before = state();
  // It is in an alarm from the line that tells of one; its place is that of the report before, until it has asked again.
  await sleep(1000);
  const there = x();
  ensure(there < FAR, 'it has moved on');
  if (before === 'Alarm') server.command('unlock');
  await until(() => state() === 'Idle');
  await sleep(1000);
  ensure(there === x(), `the position was ${there} in ${before}, and is ${x()}`);
  // To where a job begins on a board that a later connection does not reset.
  for (const line of ['G0 Z0', 'G0 X0']) server.command('gcode', line);
  await until(() => x() === 0 && z() === 0 && state() === 'Idle');
  return `${before}, ${heard('ALARM:') || 'no alarm'}, at X ${there} of ${FAR}`;
}

async function start() {
  await server.load(job, gcode);
  server.command('gcode:start');
  await until(() => server.workflow === 'running' && server.sender.total > 0);
  return `${server.sender.total} lines, with its own wait at the end`;
}

function notRefused() {
  ensure(server.workflow !== 'paused', `it has paused: ${server.lines.filter((line) => /error/.test(line)).at(-1)}`);
}

async function hold() {
  await until(() => {
    notRefused();
    return server.answered > server.sender.total / 10 && state() === 'Run';
  });
  server.command('gcode:pause');
  await until(() => state() === 'Hold' && Number(status().subState) === 0);
  const place = () => JSON.stringify(status().mpos);
  const there = place();
  await sleep(1000);
  ensure(there === place() && state() === 'Hold', 'it moves in hold');
  server.command('gcode:resume');
  await until(() => state() === 'Run');
  return 'stands in Hold:0, goes on';
}

async function finish() {
  await until(() => {
    notRefused();
    return server.workflow === 'idle';
  });
  const { total } = server.sender;
  ensure(server.answered === total, `answered ${server.answered} of ${total}`);
  await within(5000, () => state() === 'Idle');
  return `${total} of ${total} lines answered, ${state()} at ${Object.values(status().mpos).join(' ')}`;
}

main(async () => {
  await step('start', 60, () => server.start());
  await step('connect', 20, connect);
  await step('settings', 60, settings);
  await step('jog', 60, jog);
  await step('jog cancel', 60, cancel);
  await step('override', 30, overrides);
  await step('home', 60, home);
  await step('probe', 60, probe);
  await step('stop', 60, stop);
  await step('close', 20, () => server.close());
  await step('reconnect', 20, connect);
  await step('stream', 20, start);
  await step('hold', 60, hold);
  await step('finish', 600, finish);
  await step('close', 20, () => server.close());
}, () => server.stop());
