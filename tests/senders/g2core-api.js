// g2core-api, the library: node g2core-api.js PORT JOB

'use strict';

require('./serialport4');
const fs = require('fs');
const installed = require('./installed');
const { step, NotYet, sleep, until, within, ensure, main } = require('./steps');

const G2coreAPI = installed('g2core-api');
const [port, job] = process.argv.slice(2);

const lines = fs.readFileSync(job, 'utf8').split('\n').length;

const HOLD = 6;
const SETTING = 'xvm';

let g2;
/// The newest of everything that status reports have told.
let sr;
let errors;
let answered;

async function connect() {
  g2 = new G2coreAPI();
  [sr, errors, answered] = [{}, [], 0];
  g2.on('statusChanged', (news) => Object.assign(sr, news));
  g2.on('error', (error) => errors.push(error.message || String(error)));
  g2.on('response', () => (answered += 1));
  const ready = new Promise((resolve) => g2.once('setupDone', resolve));
  const banner = new Promise((resolve) => g2.once('connected', resolve));
  g2.open(port, {});
  const { fb, msg } = await banner;
  await ready;
  ensure(errors.length === 0, errors.join('; '));
  return `build ${fb} says ${msg}`;
}

async function close() {
  const closed = new Promise((resolve) => g2.once('close', resolve));
  g2.close();
  await closed;
  await sleep(300); // The simulated board looks now and then whether somebody has the port open.
  return 'port closed';
}

async function settings() {
  const before = await g2.get(SETTING);
  const other = before === 700 ? 600 : 700;
  ensure((await g2.set(SETTING, other)) === other, 'the new value is not taken');
  await close();
  await connect();
  ensure((await g2.get(SETTING)) === other, 'the new value is not kept');
  ensure((await g2.set(SETTING, before)) === before, 'the old value is not taken');
  return `${SETTING} ${before}, written ${other}, kept over a reset, written ${before}`;
}

let sent;
let finished;

async function stream() {
  sent = 0;
  g2.on('sentRaw', (text) => (sent += /^N\d/.test(text)));
  finished = undefined;
  g2.sendFile(job, (error) => (finished = { error }));
  await until(() => sr.stat === 5);
  return 'the machine runs';
}

async function hold() {
  await until(() => sent > lines / 10 && sr.vel > 0);
  g2.write('!');
  const held = await within(5000, () => sr.stat === HOLD);
  if (!held) {
    g2.write('~');
    return new NotYet('the machine took no notice of `!`');
  }
  await within(5000, () => sr.vel === 0);
  const place = () => JSON.stringify([sr.posx, sr.posy, sr.posz]);
  const there = place();
  await sleep(1000);
  ensure(there === place() && sr.stat === HOLD, 'it moves in hold');
  g2.write('~');
  await until(() => sr.stat !== HOLD && sr.vel > 0);
  return 'stands in state 6, goes on';
}

async function finish() {
  await until(() => finished || errors.length > 0);
  ensure(errors.length === 0, errors.join('; '));
  ensure(!finished.error, `ended with ${JSON.stringify(finished.error)}`);
  await until(() => sr.stat === 4);
  return `${sent} lines sent, with its own M30; state ${sr.stat}`;
}

async function positions() {
  const at = Object.values(await g2.get('mpo')).slice(0, 3);
  return `X Y Z ${at.join(' ')}`;
}

main(async () => {
  await step('start', 5, async () => {
    return `g2core-api ${installed('g2core-api/package.json').version}, node ${process.version}`;
  });
  await step('connect', 20, connect);
  await step('settings', 60, settings);
  await step('stream', 20, stream);
  await step('hold', 60, hold);
  await step('finish', 600, finish);
  await step('positions', 20, positions);
  await step('close', 20, close);
}, async () => {});
