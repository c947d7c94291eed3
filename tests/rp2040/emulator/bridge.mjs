// node bridge.mjs: an emulated board for a program that talks to it over standard input and output. Each line of the input is a request in JSON, each line of
// the output its answer:
//
//   {"board": {"elf": "file", "motors": [[step, dir], ...], "drivers": [address, ...], "registers": [{"data": gpio, "clock": gpio, "latch": gpio, "outputs": n}, ...]}, "cut": true, "stick": true, "panic": "file", "crash": "stack", "reset": true, "sense": [[channel, value]], "send": [[port, "hex"]], "now": [[port, byte]], "usb": {"open": bool, "reads": bool}, "faults": [["sleep", ms], ...], "ask": [[byte, ...]], "unmasked": true, "loaded": true, "baud": [[port, rate]], "drive": [[gpio, high]], "wire": [...], "spindle": {"index": gpio, "sync": gpio, "pulses": n}, "noise": {"gpio": gpio, "period": cycles}, "marks": n, "turn": rpm, "drivers": [...], "ails": [{"address": n, "powered": bool, "deaf": bool, "reset": true, "status": bits, "global": bits}], "card": {"file": "image", "select": gpio, "clock": gpio}, "slot": {"there": bool, "access": us, "keep": "file"}, "record": bool, "until": cycle, "line": true}
//
// `board` comes first, and again where another board is to take the place of the one before. Ports are 0 and 1 for the UARTs, and 2 for USB; `usb` says what the program at its other end does, `faults` what goes wrong there (`trouble`), `ask` which requests the computer makes.
// With `record` edges of steps are recorded from there on, or what has been recorded is told and no more is. With `cut` the supply fails, and comes again; with `stick` the CPU gets stuck. What is sent and driven comes next; then the board runs to the cycle, or, with `line`, to the end of the next line that it says.
import { readFileSync, writeFileSync } from 'node:fs';
import { createInterface } from 'node:readline';
import { Machine } from './machine.mjs';
import { Motors, Noise, Spindle } from './pins.mjs';
import { Register } from './register.mjs';
import { SdCard } from './sdcard.mjs';
import { Drivers } from './tmc2209.mjs';

const PWM = 0x40050000;
const FUNCTION_PWM = 4;
// The override of a pin's output.
const INVERT = 1;

let elf, machine, motors, drivers, registers, card;
// What the answer tells of edges.
let recorded;

function powerUp(board) {
  ({ elf } = board);
  machine = new Machine(elf);
  registers = (board.registers ?? []).map((register, which) => new Register(machine, which, register));
  motors = new Motors(machine, board.motors.map(([step, dir]) => ({ step, dir })));
  drivers = new Drivers(machine, motors, board.drivers);
}

// Pulls the card or puts it back, and keeps what is on it.
function handle({ there, access, keep }) {
  if (there !== undefined) card.isThere = there;
  if (access !== undefined) card.access = access;
  if (keep) writeFileSync(keep, card.image);
}

function act(request) {
  if (request.board) powerUp(request.board);
  if (request.cut) {
    machine.cutPower();
    registers.forEach((register) => register.powerUp());
  }
  if (request.stick) machine.stick();
  if (request.panic) machine.panic(elf, request.panic);
  if (request.crash) machine.crash(request.crash);
  if (request.reset) machine.reset();
  if (request.loaded) machine.startLoaded();
  if (request.unmasked) [machine.masked, machine.longest] = [0, machine.longest.map(() => 0)];
  for (const [channel, value] of request.sense ?? []) machine.sense(channel, value);
  for (const [port, rate] of request.baud ?? []) if (machine.senders[port]) machine.senders[port].rate = rate;
  for (const [port, hex] of request.send ?? []) machine.send(port, Buffer.from(hex, 'hex'));
  for (const [port, byte] of request.now ?? []) machine.sendNow(port, byte);
  if (request.usb) machine.talk(request.usb);
  if (request.faults) machine.trouble(request.faults);
  for (const packet of request.ask ?? []) machine.ask(packet);
  for (const [gpio, high] of request.drive ?? []) motors.drive(gpio, high);
  if (request.wire) motors.wire(request.wire);
  if (request.drivers) drivers.wire(request.drivers);
  drivers.ail(request.ails ?? []);
  if (request.card) card = new SdCard(machine, { ...request.card, image: readFileSync(request.card.file) });
  if (request.slot) handle(request.slot);
  if (request.spindle) machine.spindle = new Spindle(machine, request.spindle);
  if (request.noise) machine.noise = new Noise(machine, request.noise);
  if (request.marks !== undefined) machine.spindle.setMarks(request.marks);
  if (request.turn !== undefined) machine.spindle.turn(request.turn);
  recorded = request.record === undefined ? undefined : motors.record(request.record);
  const lines = machine.lines;
  machine.runUntil(request.until ?? 0, () => request.line && machine.lines !== lines);
}

// What part of its period each pin is high that pulses, by the registers of its slice.
function shares() {
  const { mcu } = machine;
  const pulsing = [...mcu.gpio.keys()].filter((gpio) => mcu.gpio[gpio].functionSelect === FUNCTION_PWM);
  return pulsing.map((gpio) => {
    const slice = PWM + 0x14 * (gpio >> 1 & 7);
    const compare = mcu.readUint32(slice + 0xc) >>> (gpio & 1 ? 16 : 0) & 0xffff;
    const share = Math.min(1, compare / mcu.readUint32(slice + 0x10));
    return [gpio, (mcu.gpio[gpio].ctrl >> 8 & 3) === INVERT ? 1 - share : share];
  });
}

// What the computer at the other end of USB knows.
function bus() {
  const { computer, usb } = machine;
  const hex = (bytes) => (typeof bytes === 'string' ? bytes : Buffer.from(bytes).toString('hex'));
  const answered = computer.answered.map(hex);
  computer.answered = [];
  const { ready = false, attached, lost } = computer;
  return { ready, attached, lost, hangs: usb.hangs, answered, descriptors: hex(computer.descriptors ?? []) };
}

function answer() {
  const heard = machine.heard.map((bytes) => Buffer.from(bytes).toString('hex'));
  machine.heard = [[], [], []];
  return {
    cycle: machine.cycle,
    heard,
    steps: motors.positions,
    totals: motors.totals,
    gaps: motors.gaps.map((gap) => (Number.isFinite(gap) ? gap : null)),
    last: motors.lastStep,
    rotors: drivers.rotors,
    levels: machine.levels.slice(0, 30).reduce((bits, level, gpio) => bits + (level === 1 ? 2 ** gpio : 0), 0),
    registers: registers.map(({ held, least }) => ({ held, least: Number.isFinite(least) ? least : null })),
    shares: shares(),
    units: machine.mcu.gpio.map(({ functionSelect }) => functionSelect),
    floated: machine.floated >>> 0,
    strong: machine.mcu.gpio.reduce((bits, { padValue }, gpio) => bits + ((padValue >> 4 & 3) === 3 ? 2 ** gpio : 0), 0),
    asleep: machine.asleep,
    spent: machine.spent,
    runs: machine.runs,
    longest: machine.longest,
    masked: machine.masked,
    waited: machine.cache.waited,
    stack: machine.deepest(),
    resets: machine.resets,
    waiting: machine.computer.bytes.length,
    bus: bus(),
    loads: machine.loads,
    recorded,
  };
}

for await (const line of createInterface({ input: process.stdin })) {
  let result;
  try {
    act(JSON.parse(line));
    result = answer();
  } catch (error) {
    result = { fault: String(error.stack ?? error) };
  }
  process.stdout.write(`${JSON.stringify(result)}\n`);
}
