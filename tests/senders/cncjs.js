// CNCjs, its TinyG controller, through its own server: node cncjs.js PORT JOB

'use strict';

const fs = require('fs');
const buttons = require('./cncjs-buttons');
const Server = require('./cncjs-server');
const { step, NotYet, sleep, until, within, ensure, main } = require('./steps');

const [port, job] = process.argv.slice(2);
const gcode = fs.readFileSync(job, 'utf8');
const server = new Server(port);

const READY = [1, 3, 4];
const HOLD = 6;
/// Values that it asks of status reports; more if the board knows more of spindles.
const REPORTED = 34;
const SETTING = 'xvm';

/// What the firmware answers to a line that is typed in.
async function ask(line, token) {
  const from = server.lines.length;
  server.type(line);
  const answer = () => server.lines.slice(from).find((text) => text.startsWith(`{"r":{"${token}":`));
  const { r, f } = JSON.parse(await until(answer));
  ensure(f[1] === 0, `${line} is refused with status ${f[1]}`);
  return r[token];
}

/// Opens the port, which resets the board, as DTR does: the first lines are lost.
async function connect() {
  await server.open();
  await until(() => READY.includes(server.sr.machineState) && server.settings.fb);
  await until(() => server.controller.qr > 0 && Object.keys(server.controller.pwr).length > 0);
  return `build ${server.settings.fb}, state ${server.sr.machineState}, queue ${server.controller.qr}`;
}

/// Opens the port while somebody has it open, which resets nothing: every question is heard, and
/// every answer has to be there.
async function connectAwake() {
  const flags = fs.constants.O_RDWR | fs.constants.O_NOCTTY | fs.constants.O_NONBLOCK;
  const other = fs.openSync(port, flags);
  await sleep(1000);
  server.lines.length = 0;
  await connect();
  fs.closeSync(other);
  const answer = (start) => server.lines.find((line) => line.startsWith(`{"r":{"${start}`));
  for (const start of ['ej":1', 'jv":4', 'qv":1', 'sv":1', 'si":200', 'spc":null', 'sr":{"stat":1,']) {
    await until(() => answer(start));
  }
  const reported = Object.keys(JSON.parse(answer('sr":')).r.sr);
  ensure(reported.length >= REPORTED, `only ${reported.length} values reported: ${reported}`);
  return `${reported.length} values reported, modal ${Object.values(server.sr.modal).join(' ')}`;
}

async function settings() {
  const before = await ask(`{${SETTING}:n}`, SETTING);
  const other = before === 700 ? 600 : 700;
  ensure((await ask(`{${SETTING}:${other}}`, SETTING)) === other, 'the new value is not taken');
  await server.close();
  await connect();
  ensure((await ask(`{${SETTING}:n}`, SETTING)) === other, 'the new value is not kept');
  ensure((await ask(`{${SETTING}:${before}}`, SETTING)) === before, 'the old value is not taken');
  return `${SETTING} ${before}, written ${other}, kept over a reset, written ${before}`;
}

/// Fails if it has paused of its own accord, which it does when a line is refused.
function notRefused() {
  const why = () => JSON.stringify(server.sender.holdReason || server.lines.at(-1));
  ensure(server.workflow !== 'paused', `it has paused: ${why()}`);
}

/// Complaints there were before the job: numbers that are missing while it could not ask for them.
let before;

function noComplaints(accept = () => false) {
  const complaints = server.complaints().slice(before).filter((line) => !accept(line));
  ensure(complaints.length === 0, `${complaints.length} complaints: ${complaints[0]}`);
}

/// Whether all that it minds is that it has sent more lines than this answer is for. It resumes with the next
/// line whether or not the last is answered, which it cannot be while the queue is full, and stays ahead.
function isAhead(complaint) {
  const [, answered, sent] = complaint.match(/n \((\d+)\) === sent \((\d+)\)/) || [];
  return Number(sent) > Number(answered);
}

async function start() {
  before = server.complaints().length;
  await server.load(job, gcode);
  server.command('gcode:start');
  await until(() => {
    notRefused();
    return server.workflow === 'running' && server.sender.total > 0;
  });
  return `${server.sender.total} lines, with its own wait at the end`;
}

/// Holds in the middle of a move: the machine says so, stands, and is where it was until it goes on.
async function hold() {
  await until(() => {
    notRefused();
    return server.answered > server.sender.total / 10 && server.sr.velocity > 0;
  });
  noComplaints();
  server.command('gcode:pause');
  const held = await within(5000, () => server.sr.machineState === HOLD);
  const place = () => JSON.stringify(server.sr.mpos);
  if (held) {
    await within(5000, () => server.sr.velocity === 0);
    const there = place();
    await sleep(1000);
    ensure(there === place() && server.sr.machineState === HOLD, 'it moves in hold');
  }
  server.command('gcode:resume');
  await until(() => server.workflow !== 'paused');
  if (!held) return new NotYet('paused CNCjs, but the machine took no notice of `!`');
  await until(() => server.sr.machineState !== HOLD && server.sr.velocity > 0);
  return 'stands in state 6, goes on';
}

async function finish() {
  await until(() => {
    notRefused();
    return server.workflow === 'idle';
  });
  const { total } = server.sender;
  ensure(server.answered === total, `answered ${server.answered} of ${total}`);
  noComplaints(isAhead);
  return `${total} of ${total} lines answered, state ${server.sr.machineState}`;
}

async function positions() {
  const at = Object.values(await ask('{mpo:n}', 'mpo')).slice(0, 3);
  return `X Y Z ${at.join(' ')}`;
}

main(async () => {
  await step('start', 60, () => server.start());
  await step('connect', 20, connect);
  await step('settings', 60, settings);
  for (const [name, press] of Object.entries(buttons)) {
    await step(name, 60, () => press(server));
  }
  await step('close', 20, () => server.close());
  await step('connect, no reset', 20, connectAwake);
  await step('stream', 20, start);
  await step('hold', 60, hold);
  await step('finish', 600, finish);
  await step('positions', 20, positions);
  await step('close', 20, () => server.close());
}, () => server.stop());
