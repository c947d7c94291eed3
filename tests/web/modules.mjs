// Modules of the page that need no browser, in Node: `node modules.mjs FOLDER`, the folder of the built page.

import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import path from 'node:path';
import { test } from 'node:test';
import { pathToFileURL } from 'node:url';

const folder = path.resolve(process.argv[2]);
const load = (name) => import(pathToFileURL(path.join(folder, name)));
const { Sender, linesOf } = await load('sender.js');
const { Lines, answerStatus, nameIn } = await load('protocol.js');
const { Firmware } = await load('firmware.js');
const { asLines, load: settingsLoad, read, requests, save } = await load('settings-file.js');
const { choices } = await load('settings-choices.js');
const { pathOf } = await load('path.js');
const { binned, range } = await load('bins.js');
const { runJob } = await load('job-run.js');
const { check } = await load('verify.js');
const module = new WebAssembly.Module(readFileSync(path.join(folder, 'kerf.wasm')));

const OK = '{"r":{},"f":[1,0,7]}';
const refusal = (status) => `{"r":{},"f":[1,${status},7]}`;
const job = (count) => Array.from({ length: count }, (_, n) => `G1 X${n}`).join('\n');

test('the module needs nothing of the page', () => assert.deepEqual(WebAssembly.Module.imports(module), []));

test('four lines wait at the most, and 500 bytes', () => {
  const sender = new Sender(linesOf(job(10)), 10);
  assert.equal(sender.take().split('\n').length, 5);
  assert.equal(sender.take(), '');
  sender.hear('{"sr":{"posx":1}}');
  sender.hear('{"r":{"msg":"SYSTEM READY"},"f":[1,0,0]}');
  sender.hear('{"r":{"prb":{"e":1}},"f":[1,0,0]}');
  assert.equal(sender.take(), '');
  sender.hear(OK);
  assert.equal(sender.take(), 'G1 X4\n');
  const long = new Sender(linesOf(Array(4).fill(`(${'x'.repeat(240)})`).join('\n')), 4);
  assert.equal(long.take().split('\n').length, 3);
});

test('what somebody types meanwhile is not taken for an answer of the job', () => {
  const sender = new Sender(linesOf(job(10)), 10);
  sender.take();
  sender.foreign('{mfo:1.5}');
  sender.foreign('$xvm');
  assert.equal(sender.hear('{"r":{"mfo":1.500},"f":[1,0,7]}'), false);
  assert.equal(sender.hear('tinyg [mm] ok> '), false);
  assert.equal(sender.take(), '');
  assert.equal(sender.hear('tinyg [mm] ok> '), true);
  assert.equal(sender.take(), 'G1 X4\n');
  sender.foreign('M8');
  for (let n = 0; n < 5; n++) sender.hear(OK);
  assert.equal(sender.take().split('\n').length, 5);
});

test('a strict sender stops at a refusal and at an alarm', () => {
  const lines = () => linesOf(job(10));
  const strict = new Sender(lines(), 10, true);
  strict.take();
  strict.hear(refusal(131));
  assert.equal(strict.take(), '');
  for (let n = 0; n < 3; n++) strict.hear(OK);
  assert.ok(strict.done);
  assert.match(strict.stopped, /line 1 was refused with 131/);
  const alarmed = new Sender(lines(), 10, true);
  alarmed.take();
  alarmed.hear('{"er":{"fb":440.20,"st":204,"msg":"Limit","sw":"xmin"}}');
  assert.match(alarmed.stopped, /204/);
  const waiting = new Sender(lines(), 10, true);
  waiting.take();
  waiting.hear('{"er":{"fb":440.20,"st":38,"msg":"stop"}}');
  assert.equal(waiting.stopped, '');
});

test('characters that act at once are left out of a job', () => {
  const lines = [...linesOf('%\nG1 X1 (wow!)\r\n\n(\u2013 50 %)\x18\nG0\n')];
  assert.deepEqual(lines.map(({ number, text }) => [number, text]), [[2, 'G1 X1 (wow)'], [4, '(  50 )'], [5, 'G0']]);
  assert.deepEqual(lines.map(({ left }) => left), [true, true, false]);
});

test('answers in each manner of talking', () => {
  const cases = [['ok', 0], ['error:20', 20], [OK, 0], ['{r:{xvm:800},f:[1,0,7]}', 0], [refusal(108), 108], ['tinyg [mm] ok> ', 0], ['tinyg [mm] err: x', -1], ['{"qr":5}', undefined], ['{"r', undefined], ['Grbl 1.1h', undefined]];
  for (const [line, status] of cases) assert.equal(answerStatus(line), status, line);
  assert.equal(nameIn('{"x":{vm:n}}'), 'x');
  assert.equal(nameIn('g1'), undefined);
  const lines = new Lines();
  assert.deepEqual([...lines.add('a\r\nb'), ...lines.add('c\x13\n')], ['a', 'bc']);
});

test('settings are sent in an order that a machine takes', () => {
  const file = { sys: { fb: 440.2, mch: 1, jv: 4, est: 1, ct: 0.01 }, x: { vm: 800 }, 1: { ma: 0 }, g54: { x: 1 }, g28: { x: 5 } };
  assert.deepEqual(requests(file), ['{mch:1}', '{1:{ma:0}}', '{x:{vm:800}}', '{ct:0.01}', '{g54:{x:1}}', '{est:1}', '{jv:4}']);
  assert.deepEqual(read(JSON.stringify(file)), requests(file));
  assert.deepEqual(read(asLines(file)), requests(file));
  assert.throws(() => read('G1 X1\n'), /no setting/);
  assert.throws(() => read('{"a1":{}}'), /no group/);
  assert.throws(() => read(''), /empty/);
});

test('choices come from the descriptions, or not at all', () => {
  const of = (description, maximum = 1) => choices({ type: 'integer', minimum: 0, maximum, description });
  assert.deepEqual(of('Reports. 0 off, 1 on.'), ['off', 'on']);
  assert.equal(of('Reports: 0 is off.'), undefined);
  assert.equal(of('0 off, 1 on, 2 both', 9), undefined);
});

test('a path keeps its corners', () => {
  const steps = [];
  for (let x = 0; x <= 1_000; x += 10) steps.push(x, 0, 0, 0);
  for (let y = 10; y <= 1_000; y += 10) steps.push(1_000, y, 0, 0);
  const axis = (motor) => ({ motor, scale: 0.01, origin: 0 });
  const { vertices, samples } = pathOf(Int32Array.from(steps), [axis(0), axis(1), undefined]);
  const places = [...samples].map((_, n) => `${vertices[3 * n].toFixed(2)},${vertices[3 * n + 1].toFixed(2)}`);
  assert.ok(samples.length < 24 && places.includes('10.00,0.00'), places.join(' '));
  assert.equal(places.at(-1), '10.00,10.00');
  assert.equal(pathOf(new Int32Array(), [undefined, undefined, undefined]).samples.length, 0);
});

test('a job runs in Node as in the page: stops, homing, an alarm', async () => {
  const text = 'G21\nM0\nG28.2 X0\nG38.2 Z-5 F200\nG1 X3 F500\nM2\n';
  const result = await runJob(module, { text });
  assert.deepEqual(result.refused, []);
  assert.equal(result.finalSteps[0], 3_840);
  assert.ok(result.notes.some(({ line, text }) => line === 3 && /Homing/.test(text)));
  assert.ok(result.notes.some(({ status }) => status === 250), 'no contact');
  const cancelled = await runJob(module, { text: job(50_000).replaceAll('X', 'F800 X') }, () => false);
  assert.equal(cancelled, undefined);
});

test('curves are those of the steps, with the limits of their axes', async () => {
  const text = 'G21\nG1 X20 Y10 F600\nG4 P0.1\nG0 Z3\n';
  const { curves, speed, steps, windowMs, intervalMs } = await runJob(module, { text, settings: ['{xac:80,xjm:400}'] });
  assert.deepEqual(curves.map(({ axis }) => axis), ['x', 'y', 'z']);
  assert.deepEqual([windowMs, intervalMs], [10, 2]);
  const [{ limits, velocity, acceleration, jerk }] = curves;
  assert.equal(limits.acceleration, 80);
  assert.ok(Math.abs(limits.jerk - 1_851.85) < 0.1 && limits.velocity > 10);
  for (const curve of [speed, velocity, acceleration, jerk]) assert.equal(curve.length, steps.length / 4);
  const most = (curve) => curve.reduce((most, value) => Math.max(most, Math.abs(value)), 0);
  assert.ok(Math.abs(most(velocity) - 10 / Math.hypot(1, 0.5)) < 0.1, `${most(velocity)} mm/s`);
  assert.ok(most(acceleration) > 70 && most(acceleration) < 88, `${most(acceleration)} mm/s2`);
  assert.ok(most(jerk) > 1_000 && most(jerk) < 2_000, `${most(jerk)} mm/s3`);
  const way = velocity.reduce((sum, v) => sum + v, 0) * 0.002;
  assert.ok(Math.abs(way - 20) < 0.05, `${way} mm`);
});

test('bins keep the extremes of each curve, and limits that are near', () => {
  const flat = new Float32Array(50_000);
  const spike = Float32Array.from(flat, (_, n) => (n === 31_234 ? 9 : 1));
  const [times, ...values] = binned([flat, spike], 2, 0, 100, 10);
  assert.ok(times.length <= 1_402 && times.every((time, n) => n === 0 || time > times[n - 1]));
  assert.deepEqual(values.map((of) => of.length), [times.length, times.length]);
  assert.ok(values[1].includes(90) && !values[0].includes(90));
  assert.deepEqual(binned([Float32Array.of(1, 2, 3)], 2, 0, 1, 1), [[0, 0.002, 0.004], [1, 2, 3]]);
  const [low, high] = range(-5, 40, [50, 500, Infinity]);
  assert.ok(low < -50 && low > -60 && high > 50 && high < 60);
  assert.deepEqual(range(0, 0, [50]), [-1, 1]);
});

/// A machine as `settings-file.js` wants one.
class Machine {
  #firmware = new Firmware(module);
  constructor() {
    this.#firmware.boot();
    this.#firmware.run(100);
  }

  async ask(line) {
    this.#firmware.heard();
    this.#firmware.send(`${line}\n`);
    let heard = '';
    for (let n = 0; n < 200 && !/"f":\[.*\n/.test(heard); n++) {
      this.#firmware.run(10);
      heard += this.#firmware.heard();
    }
    const answer = heard.split('\n').find((text) => text.includes('"f":['));
    return { body: JSON.parse(answer).r, status: answerStatus(answer) };
  }
}

test('settings go from one machine to another by either file', async () => {
  const first = new Machine();
  for (const line of ['{mch:1}', '{xvm:4321}', '{g55:{x:5,y:6}}', '{tt3:{z:7.5}}', '{est:1}', '{si:200}']) assert.equal((await first.ask(line)).status, 0, line);
  const file = await save(first);
  for (const text of [JSON.stringify(file), asLines(file)]) {
    const second = new Machine();
    assert.deepEqual(await settingsLoad(second, read(text)), []);
    assert.deepEqual(await save(second), file);
  }
  const wrong = await settingsLoad(new Machine(), ['{x:{vm:-1,fr:500}}']);
  assert.deepEqual(wrong, [{ line: '{x:{vm:-1}}', status: 108 }]);
  const seen = await runJob(module, { text: 'G0 X1', settings: ['{g55:{x:5,y:6}}'], zero: [1, 2, 3] });
  assert.deepEqual(seen.systems, [{ name: 'G55', place: [4, 4, -3] }]);
});

test('a dry run has the settings that it is given', async () => {
  const run = (settings) => runJob(module, { text: 'G0 X50', settings });
  const [slow, fast] = [await run([]), await run(['{xvm:1600}'])];
  assert.ok(fast.ms < slow.ms * 0.65, `${slow.ms} ms, ${fast.ms} ms`);
  await assert.rejects(run(['{xvm:-1}']), /refused with status 108/);
});

/// A board at a port, as `verify.js` wants one, in simulated time. From `silentMs` on nothing comes from it. `pace` is
/// its clock, compared with the computer's.
class BoardLink {
  broken = '';
  #heard = '';
  #ms = 0;
  #board;

  constructor({ dialect = 'tinyg', silentMs = Infinity, pace = 1 } = {}) {
    Object.assign(this, { silentMs, pace });
    this.#start(new Uint8Array());
    if (dialect === 'tinyg') return;
    this.#board.run(100);
    this.#board.send('{dia:3}\n');
    this.#board.run(2_000);
    this.#start(this.#board.eeprom());
  }

  #start(eeprom, asked = false) {
    this.#board = new Firmware(module);
    this.#board.boot(eeprom, asked);
  }

  now() {
    return this.#ms;
  }

  take() {
    const heard = this.#heard;
    this.#heard = '';
    return heard;
  }

  wait(until) {
    while (this.#ms < until && this.#heard === '') this.#pass();
  }

  /// Lets 5 ms of the computer's clock pass.
  #pass() {
    this.#ms += 5;
    this.#board.run(Math.round(this.#ms * this.pace) - Math.round((this.#ms - 5) * this.pace));
    if (this.#ms < this.silentMs) this.#heard += this.#board.heard();
    if (this.#board.state().reset) this.#start(this.#board.eeprom(), true);
  }

  send(bytes) {
    this.#board.send(bytes);
  }

  reset() {
    this.#start(this.#board.eeprom());
    this.take();
  }

  /// Returns what the board says to a request in half a second.
  answer(request) {
    this.take();
    this.#board.send(request);
    for (let n = 0; n < 100; n++) this.#pass();
    return this.take();
  }
}

async function checked(link, dialect = 'tinyg') {
  const lines = [];
  const { isSound, verdict, file } = await check(new Firmware(module), link, { dialect, seed: 7, tell: (line) => lines.push(line) });
  return { isSound, verdict, file, lines, seconds: link.now() / 1_000 };
}

test('a sound board is found sound in both dialects, and keeps its settings', async (context) => {
  for (const dialect of ['tinyg', 'grbl']) {
    const link = new BoardLink({ dialect });
    link.answer('');
    const asked = dialect === 'grbl' ? '$$\n' : '{uda:n}\n{udd:n}\n{1:n}\n';
    const settings = () => [...link.answer(asked).matchAll(/\$\d+=.*|\{"r":\{"(?:ud.|1)":\{.*?\}\}/g)].join('\n');
    const before = settings();
    const { isSound, verdict, file, lines, seconds } = await checked(link, dialect);
    context.diagnostic(`${dialect}: ${verdict} ${seconds} s of the board`);
    assert.ok(isSound, file);
    assert.match(file, /clock of Kerf \| ok/);
    assert.match(file, /Only Kerf itself was checked.*cargo xtask verify/);
    assert.ok(lines.some((line) => line.includes('job: ')), lines.join('\n'));
    assert.ok(seconds < 60, `${seconds} s`);
    assert.ok(before.includes(dialect === 'grbl' ? '$123=' : '{"1":'), before);
    assert.equal(settings(), before);
  }
});

test('a board that falls silent, and one whose clock is wrong, have findings', async () => {
  const silent = await checked(new BoardLink({ silentMs: 12_000 }));
  assert.ok(!silent.isSound && silent.seconds < 60, silent.file);
  assert.match(silent.file, /FAILED \| .*no answer within/);
  const fast = await checked(new BoardLink({ pace: 1.03 }));
  assert.match(fast.verdict, /^1 of /);
  assert.match(fast.file, /clock of Kerf \| FAILED/);
});

test('a port that fails ends the checks', async () => {
  const link = new BoardLink();
  link.send = () => (link.broken = 'unplugged');
  const { isSound, file, seconds } = await checked(link);
  assert.ok(!isSound && seconds < 5, file);
  assert.match(file, /FAILED \| `unplugged/);
});
