// The Worker of the simulated machine that the page is connected to. Runs the machine at real time, faster, or as fast
// as possible.
//
// | message | meaning |
// |---|---|
// | `{ module }` | comes first: boots a new machine |
// | `{ send, port }`, `{ line }` | characters for a port; a line that the user has typed |
// | `{ speed }` | multiple of real time; Infinity for as fast as possible |
// | `{ stream }`, `{ stopStream: true }` | sends a job by counting responses; sends no more of it |
// | `{ press, closed }`, `{ near: [input, step] }`, `{ spindle: { rpm, perTurn } }` | contacts and the spindle |
// | `{ snapshot: id }` | answered by `{ snapshot: id, eeprom }`, once everything is stored |
// | `{ power: true, eeprom }` | switches power off and on, with these EEPROM contents |
//
// It sends `{ heard, port }`; `{ state }` thirty times a second while something changes; `{ trail }`, the steps between
// two states; `{ booted }`; and for a job `{ progress }` and `{ streamed }`. A machine that needs more time than the
// computer has falls behind real time; `state.behind` then says so.

import { Firmware } from './firmware.js';
import { Lines } from './protocol.js';
import { Sender, linesOf } from './sender.js';

/// Milliseconds between two turns, and the most of them that the machine may take.
const TURN_MS = 16;
const BUSY_MS = 12;
/// Longest lag behind real time that is made up for, ms.
const LATEST_MS = 250;
const TELL_MS = 33;
/// A write to EEPROM takes 3.4 ms a byte. A changed setting is stored within a second.
const STORED_MS = 600;

let module;
let firmware;
let speed = 1;
let sender;
let lines = new Lines();
let switches = [];
let due = 0;
let last = performance.now();
let told = 0;
let before = '';
/// Number of states in a row without a change.
let quiet = 0;

function boot(eeprom, asked) {
  firmware = new Firmware(module);
  firmware.boot(eeprom, asked);
  firmware.beginSamples();
  lines = new Lines();
  for (const [input, step] of switches) firmware.near(input, step);
  endStream('the machine has started anew');
  postMessage({ booted: true });
}

function endStream(why) {
  if (!sender) return;
  const { answered, refused, notes } = sender;
  sender = undefined;
  postMessage({ streamed: { answered, refused, notes, why } });
}

/// Runs for up to `ms` of the machine's time while the computer has time. Returns the milliseconds that have passed.
function run(ms) {
  const end = performance.now() + BUSY_MS;
  let passed = 0;
  while (passed < ms && performance.now() < end) {
    if (sender) {
      const text = sender.take();
      if (text) firmware.send(text);
    }
    const step = Math.min(ms - passed, sender ? 50 : 20);
    const went = firmware.run(step, Boolean(sender));
    passed += went;
    listen();
    if (firmware.state().reset) {
      boot(firmware.eeprom(), true);
      break;
    }
    if (went === 0) break;
  }
  return passed;
}

function listen() {
  const heard = firmware.heard(0);
  if (heard) {
    postMessage({ heard, port: 0 });
    if (sender) {
      for (const line of lines.add(heard)) sender.hear(line);
      if (sender.done) endStream(sender.stopped);
    } else {
      lines.add(heard);
    }
  }
  const other = firmware.heard(1);
  if (other) postMessage({ heard: other, port: 1 });
}

function turn() {
  setTimeout(turn, TURN_MS);
  const now = performance.now();
  const passed = now - last;
  last = now;
  if (!firmware) return;
  // At unlimited speed the machine runs as long as it has something to do.
  const idle = !sender && quiet > 30;
  const wanted = speed === Infinity ? (idle ? passed : 1e6) : due + passed * speed;
  const whole = Math.floor(wanted);
  const went = whole > 0 ? run(whole) : 0;
  due = speed === Infinity ? 0 : Math.min(wanted - went, LATEST_MS * speed);
  if (now - told >= TELL_MS) tell(now, due >= LATEST_MS * speed);
}

function tell(now, behind) {
  told = now;
  const state = { ...firmware.state(), behind };
  const key = JSON.stringify({ ...state, ms: 0 });
  if (sender) postMessage({ progress: { sent: sender.last, total: sender.total } });
  quiet = key === before ? quiet + 1 : 0;
  if (key !== before) {
    const trail = firmware.samples();
    postMessage({ trail }, [trail.buffer]);
  }
  firmware.beginSamples();
  before = key;
  postMessage({ state });
}

/// Returns the EEPROM contents, once all changed settings are stored.
function stored() {
  for (let waited = 0, same = 0, then = ''; waited < 10_000 && same < STORED_MS; waited += 50) {
    firmware.run(50);
    const now = String(firmware.eeprom());
    same = now === then ? same + 50 : 0;
    then = now;
  }
  listen();
  return firmware.eeprom();
}

onmessage = ({ data }) => {
  if (data.module) {
    module = data.module;
    boot(data.eeprom ?? new Uint8Array(), false);
    turn();
  } else if ('send' in data) {
    quiet = 0;
    firmware.send(data.send, data.port ?? 0);
  } else if ('line' in data) {
    quiet = 0;
    sender?.foreign(data.line);
    firmware.send(`${data.line}\n`);
  } else if ('speed' in data) [speed, due] = [data.speed, 0];
  else if ('stream' in data) sender = new Sender(linesOf(data.stream), data.stream.split('\n').length, true);
  else if (data.stopStream) sender?.stop();
  else if ('press' in data) firmware.press(data.press, data.closed);
  else if ('near' in data) {
    switches.push(data.near);
    firmware.near(...data.near);
  } else if ('spindle' in data) firmware.spindle(data.spindle.rpm, data.spindle.perTurn);
  else if ('snapshot' in data) postMessage({ snapshot: data.snapshot, eeprom: stored() });
  else if (data.power) boot(data.eeprom ?? stored(), false);
};
