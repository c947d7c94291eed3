// Runs a job on a machine of its own, as fast as the computer can, and returns the results.
//
// Runs in a Worker, or in Node for tests. The machine begins at the work zero, at rest and homed, with the settings of
// the machine that is shown. Homing is assumed to succeed, and program stops (M0) are resumed at once, because there is
// no user. The error of a job that cannot begin says why.

import { Firmware } from './firmware.js';
import { Lines, answerStatus, isText, parse } from './protocol.js';
import { HARMLESS, Sender, homes, linesOf } from './sender.js';
import { pathOf } from './path.js';

/// Longest wait for an answer, ms of the machine's time: more than any move takes.
const LONGEST_MS = 24 * 3_600_000;
/// Milliseconds of the computer's time after which the run lets other tasks run.
const TURN_MS = 40;
/// With more lines than this in a second the board's CPU may be the limit. The run does not simulate that limit.
const MOST_LINES = 464;
const AXES = ['x', 'y', 'z'];
/// A jerk limit that allows the whole acceleration within this time has no effect, s.
const AT_ONCE_S = 0.001;

const breath = () => new Promise((resolve) => setTimeout(resolve, 0));

/// A conversation with the machine.
class Talk {
  #lines = new Lines();
  #heard = [];

  constructor(module, eeprom) {
    this.firmware = new Firmware(module);
    this.firmware.boot(eeprom);
    this.ms = 0;
    // Waits for the greeting.
    this.pass(100);
    this.#heard = [];
  }

  pass(ms, stops = false) {
    this.ms += this.firmware.run(ms, stops);
    this.#heard.push(...this.#lines.add(this.firmware.heard()));
  }

  line() {
    return this.#heard.shift();
  }

  /// Returns the answer to a line; throws if the line is refused.
  ask(line) {
    this.firmware.send(`${line}\n`);
    for (let waited = 0; waited < 60_000; waited += 1) {
      for (let heard = this.line(); heard !== undefined; heard = this.line()) {
        const status = answerStatus(heard);
        if (status === undefined) continue;
        if (status !== 0) throw new Error(`${line} is refused with status ${status}`);
        return parse(heard)?.r ?? {};
      }
      this.pass(50, true);
    }
    throw new Error(`no answer to ${line}`);
  }
}

/// Returns the settings of motors and axes, as the machine reports them.
function describe(talk) {
  const motors = [1, 2, 3, 4].map((m) => talk.ask(`{${m}:n}`)[m]);
  const axes = ['x', 'y', 'z', 'a', 'b', 'c'].map((axis) => talk.ask(`{${axis}:n}`)[axis]);
  const scale = motors.map((motor) => (motor.tr * motor.sa) / 360 / motor.mi);
  const motorOf = (axis) => motors.findIndex((motor) => motor.ma === axis);
  return { axes, scale, motorOf };
}

/// Returns the other coordinate systems that have an offset: name, and place in work coordinates.
function offsets(talk, zero) {
  return ['g55', 'g56', 'g57', 'g58', 'g59', 'g591', 'g592', 'g593'].flatMap((name) => {
    const { x, y, z } = talk.ask(`{${name}:n}`)[name];
    return x || y || z ? [{ name: name.replace(/^(g59)(\d)/, '$1.$2').toUpperCase(), place: [x - zero[0], y - zero[1], z - zero[2]] }] : [];
  });
}

/// Runs a job: `{ text, eeprom, settings, zero }`. `progress` is called with `{ sent, total, ms }` now and then. The
/// run ends if it returns false.
export async function runJob(module, job, progress = () => true) {
  const talk = new Talk(module, job.eeprom ?? new Uint8Array());
  const { firmware } = talk;
  for (const line of job.settings ?? []) talk.ask(line);
  talk.ask('{psw:0,sv:0,qv:0,jv:3,ej:1}');
  const { axes, scale, motorOf } = describe(talk);
  const zero = job.zero ?? defaultZero(axes);
  const systems = offsets(talk, zero);
  const inches = talk.ask('{unit:n}').unit === 0;
  talk.ask(`G21 G28.3 X${zero[0]} Y${zero[1]} Z${zero[2]}`);
  talk.ask(`G10 L2 P1 X${zero[0]} Y${zero[1]} Z${zero[2]}`);
  if (inches) talk.ask('G20');
  const limits = [...axes.map((axis) => axis.fr ?? 0), ...axes.map((axis) => axis.vm ?? 0)];
  const asked = firmware.asked(limits, job.text);

  const notes = [];
  function* sent() {
    for (const line of linesOf(job.text)) {
      if (homes(line.text)) notes.push({ line: line.number, text: 'Homing is taken for done.' });
      // Such a line has no answer that could be counted.
      else if (isText(line.text)) notes.push({ line: line.number, text: 'Not tried: a command to the machine, no G-code.' });
      else yield line;
    }
  }
  let total = 0;
  for (let at = job.text.indexOf('\n'); at >= 0; at = job.text.indexOf('\n', at + 1)) total += 1;
  const sender = new Sender(sent(), total);
  firmware.beginSamples();
  const began = talk.ms;
  const pace = { times: [], busiest: 0 };
  let turn = performance.now();
  let silent = 0;
  while (!sender.done) {
    const text = sender.take();
    if (text) firmware.send(text);
    const before = talk.ms;
    talk.pass(200, true);
    silent += talk.ms - before;
    for (let heard = talk.line(); heard !== undefined; heard = talk.line()) {
      silent = 0;
      const known = sender.notes.length;
      if (sender.hear(heard)) count(pace, talk.ms);
      const note = sender.notes[known];
      if (note?.status !== undefined && !HARMLESS.includes(note.status)) {
        note.text = 'It cannot be tried here: the alarm was cleared, and the job went on.';
        firmware.send('{clear:n}\n');
        // The answer to this line does not belong to a line of the job.
        awaitClear(talk, sender, pace);
      }
    }
    if (silent > LONGEST_MS) throw new Error(`no answer after line ${sender.last}`);
    if (performance.now() - turn > TURN_MS) {
      if (progress({ sent: sender.last, total, ms: talk.ms - began }) === false) return undefined;
      await breath();
      turn = performance.now();
    }
  }
  while (talk.ask('{stat:n}').stat === 5) {
    talk.pass(20);
    if (performance.now() - turn > TURN_MS) {
      if (progress({ sent: total, total, ms: talk.ms - began }) === false) return undefined;
      await breath();
      turn = performance.now();
    }
  }
  const ms = talk.ms - began;
  return finish({ firmware, systems, axes, scale, motorOf, zero, ms, sender, notes, asked, pace });
}

/// Waits for the answer to `{clear:n}`, and counts the answers to lines before it.
function awaitClear(talk, sender, pace) {
  for (let waited = 0; waited < 10_000; waited += 1) {
    talk.pass(20, true);
    for (let heard = talk.line(); heard !== undefined; heard = talk.line()) {
      if ('clear' in (parse(heard)?.r ?? {})) return;
      if (sender.hear(heard)) count(pace, talk.ms);
    }
  }
}

/// The default place of the work zero: the lower ends of X and Y, the middle of Z.
export function defaultZero(axes) {
  const [x, y, z] = axes;
  return [x.tn, y.tn, (z.tn + z.tm) / 2];
}

function count(pace, ms) {
  pace.times.push(ms);
  while (pace.times[0] + 1_000 <= ms) pace.times.shift();
  pace.busiest = Math.max(pace.busiest, pace.times.length);
}

/// Returns the limits of an axis, in mm and s. A limit without effect is infinite.
export function limitsOf({ vm, ac, jm }) {
  const acceleration = ac > 0 ? ac : Infinity;
  const jerk = (jm * 1e6) / 216e3;
  return { velocity: vm / 60, acceleration, jerk: jerk * AT_ONCE_S < acceleration ? jerk : Infinity };
}

function finish({ firmware, systems, axes, scale, motorOf, zero, ms, sender, notes, asked, pace }) {
  const steps = firmware.samples();
  const intervalMs = firmware.sampleMs();
  const linear = [0, 1, 2].map(motorOf);
  const speed = firmware.speed(scale.map((mm, motor) => (linear.includes(motor) ? mm : 0)));
  const extremes = firmware.extremes();
  const curves = linear.flatMap((motor, axis) => {
    const moves = motor >= 0 && extremes[motor].total > 0;
    return moves ? [{ axis: AXES[axis], limits: limitsOf(axes[axis]), ...firmware.curves(motor, scale[motor]) }] : [];
  });
  const drawn = [0, 1, 2].map((axis) => {
    const motor = motorOf(axis);
    return motor < 0 ? undefined : { motor, scale: scale[motor], origin: 0 };
  });
  const path = pathOf(steps, drawn);
  const extents = drawn.flatMap((axis, n) => {
    if (!axis) return [];
    const [from, to] = [extremes[axis.motor].lowest, extremes[axis.motor].highest].map((s) => s * axis.scale);
    const { tn, tm } = axes[n];
    return [{ axis: AXES[n], from: Math.min(from, to), to: Math.max(from, to), lower: tn - zero[n], upper: tm - zero[n] }];
  });
  let distance = 0;
  for (const v of speed) distance += v;
  const all = [...notes, ...sender.notes].sort((a, b) => a.line - b.line);
  return {
    ms,
    lines: sender.answered,
    refused: sender.refused,
    notes: all,
    asked,
    busiest: pace.busiest,
    rushed: pace.busiest > MOST_LINES,
    distance: (distance * intervalMs) / 1_000,
    extents,
    finalSteps: firmware.state().steps,
    totals: extremes.map((motor) => motor.total),
    zero,
    systems,
    drawn,
    intervalMs,
    steps,
    path,
    speed,
    curves,
    windowMs: firmware.windowMs(),
    memory: firmware.memory(),
  };
}
