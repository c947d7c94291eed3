// The firmware as a WebAssembly module: one instance is one machine. web/src/lib.rs documents each call.
//
// Owned by a Worker, or by a test in Node. Buffers that a call returns are copies.

const encoder = new TextEncoder();
/// Converts characters to bytes. Bytes above 7F act at once.
const bytesOf = (text) => Uint8Array.from(text, (character) => character.charCodeAt(0));
const decoder = new TextDecoder('latin1');

/// The number and the names of the inputs of a board, in the order of `boards::inputs`.
export const INPUTS = ['xmin', 'xmax', 'ymin', 'ymax', 'zmin', 'zmax', 'amin', 'amax', 'probe', 'door', 'stop'];

const textOf = (bytes) => new TextDecoder().decode(bytes);
/// What the checks of a board want, in the order of `Want` in web/src/verify.rs: a name, and how the contents are read.
const WANTS = [
  ['wait', (bytes) => ({ until: new Float64Array(bytes)[0] })],
  ['send', (bytes) => ({ bytes: new Uint8Array(bytes) })],
  ['reset', () => ({})],
  ['tell', (bytes) => ({ line: textOf(bytes) })],
  ['done', (bytes) => {
    const [verdict, ...file] = textOf(bytes.slice(1)).split('\n');
    return { isSound: new Uint8Array(bytes)[0] === 1, verdict, file: file.join('\n') };
  }],
];

export class Firmware {
  /// `module` is a compiled WebAssembly.Module.
  constructor(module) {
    this.wasm = new WebAssembly.Instance(module, {}).exports;
  }

  #give(bytes) {
    const at = this.wasm.input(bytes.length);
    new Uint8Array(this.wasm.memory.buffer, at, bytes.length).set(bytes);
    return bytes.length;
  }

  #take(length) {
    const at = this.wasm.output();
    return this.wasm.memory.buffer.slice(at, at + length);
  }

  /// Boots with EEPROM contents, empty for a new machine. `asked` after a reset that the firmware has asked for.
  boot(eeprom = new Uint8Array(), asked = false) {
    const length = this.#give(eeprom);
    if (this.wasm.boot(length, asked ? 1 : 0) !== 1) throw new Error('the firmware does not boot');
  }

  /// Puts text or bytes on the line of a port.
  send(data, port = 0) {
    this.wasm.send(port, this.#give(typeof data === 'string' ? bytesOf(data) : data));
  }

  /// Returns what the firmware has sent since the last call.
  heard(port = 0) {
    return decoder.decode(this.#take(this.wasm.heard(port)));
  }

  /// Runs for `ms` of the machine's time, or less: if `stops`, until the firmware ends a line. Returns the milliseconds
  /// that have passed.
  run(ms, stops = false) {
    return this.wasm.run(ms, stops ? 1 : 0);
  }

  state() {
    const [ms, s0, s1, s2, s3, outputs, pulse, powered, worked, reset] =
      new Float64Array(this.#take(this.wasm.state()));
    return { ms, steps: [s0, s1, s2, s3], outputs, pulse, powered, worked, reset: reset !== 0 };
  }

  eeprom() {
    return new Uint8Array(this.#take(this.wasm.eeprom()));
  }

  press(input, closed) {
    this.wasm.press(input, closed ? 1 : 0);
  }

  near(input, step) {
    this.wasm.near(input, step);
  }

  spindle(rpm, perTurn) {
    this.wasm.spindle(rpm, perTurn);
  }

  beginSamples() {
    this.wasm.begin_samples();
  }

  /// Returns the samples, four numbers of steps each.
  samples() {
    return new Int32Array(this.#take(this.wasm.samples()));
  }

  sampleMs() {
    return this.wasm.sample_ms();
  }

  /// Returns the speed along the path, mm/s, a value for each sample. `scale` is the length of a step of each motor, mm;
  /// 0 for a motor that does not count.
  speed(scale) {
    return new Float32Array(this.#take(this.wasm.speed(this.#give(new Uint8Array(Float64Array.from(scale).buffer)))));
  }

  /// Returns velocity, acceleration and jerk of a motor, in mm and s, a value for each sample. `mm` is the length of a
  /// step.
  curves(motor, mm) {
    const curve = (which) => new Float32Array(this.#take(this.wasm.curve(which, motor, mm)));
    return { velocity: curve(0), acceleration: curve(1), jerk: curve(2) };
  }

  /// Returns the time between positions from which accelerations are computed, ms; twice as much for velocity and jerk.
  windowMs() {
    return this.wasm.window_ms();
  }

  /// Returns the lowest and the highest position and the number of steps of each motor since the samples began.
  extremes() {
    const all = new Float64Array(this.#take(this.wasm.extremes()));
    return [0, 1, 2, 3].map((m) => ({ lowest: all[3 * m], highest: all[3 * m + 1], total: all[3 * m + 2] }));
  }

  /// Returns which lines ask for more than the limits allow. The limits are six feed limits and six velocities, per
  /// minute.
  asked(limits, text) {
    const job = encoder.encode(text);
    const bytes = new Uint8Array(96 + job.length);
    bytes.set(new Uint8Array(Float64Array.from(limits).buffer));
    bytes.set(job, 96);
    return JSON.parse(decoder.decode(this.#take(this.wasm.asked(this.#give(bytes)))));
  }

  /// Returns profiles and codes.
  tables() {
    return JSON.parse(new TextDecoder().decode(this.#take(this.wasm.tables())));
  }

  /// Prepares the checks of a real board, in this dialect. No machine is needed for them.
  verifyBegin(dialect, seed) {
    this.wasm.verify_begin(dialect === 'grbl' ? 1 : 0, seed);
  }

  /// Goes on with the checks. Returns what they want next: see `WANTS`.
  verifyStep(ms, heard) {
    const bytes = this.#take(this.wasm.verify_step(ms, this.#give(bytesOf(heard))));
    const [kind, read] = WANTS[new Uint8Array(bytes)[0]];
    return { kind, ...read(bytes.slice(1)) };
  }

  /// Tells the checks why the port does not work any more.
  verifyFail(why) {
    this.wasm.verify_fail(this.#give(encoder.encode(why)));
  }

  /// Returns the bytes of memory that the machine and its samples take.
  memory() {
    return this.wasm.memory.buffer.byteLength;
  }
}
