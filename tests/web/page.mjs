// The page in headless Chromium: `node page.mjs ADDRESS REPORT.json...`, run where playwright-core and axe-core are installed.
//
// Each step does what a visitor does and looks at what the page shows. The reports are the simulated chip's (`cargo xtask sim --report`): the
// motors of the page end at its steps. Pictures of the page and `exported.txt`, its settings, are left in the working folder. Any message of the console that is a warning or an
// error fails the run. `KERF_CHROMIUM` names another browser than the first of `BROWSERS`.

import assert from 'node:assert/strict';
import { existsSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import { tmpdir } from 'node:os';
import path from 'node:path';

const require = createRequire(path.join(process.cwd(), 'package.json'));
const { chromium } = require('playwright-core');
const [address, ...reports] = process.argv.slice(2);

const BROWSERS = ['/usr/bin/chromium', '/usr/bin/chromium-browser', '/usr/bin/google-chrome'];
/// Software draws, and nothing is fetched from elsewhere.
const FLAGS = ['--no-sandbox', '--use-gl=angle', '--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--disable-quic', '--no-first-run',
  '--disable-background-networking', '--disable-component-update', '--disable-sync'];
/// Longest wait for anything, ms.
const PATIENCE = 30_000;
/// A job of 100,000 lines: seconds of the computer, and MB of the machine's memory, at most.
const LONG = { lines: 100_000, seconds: 60, megabytes: 400 };

const messages = [];
const profile = mkdtempSync(path.join(tmpdir(), 'kerf-page-'));
const browser = await chromium.launchPersistentContext(profile, {
  executablePath: process.env.KERF_CHROMIUM ?? BROWSERS.find((file) => existsSync(file)),
  headless: true,
  acceptDownloads: true,
  viewport: { width: 1440, height: 1000 },
  colorScheme: 'light',
  args: FLAGS,
});
browser.setDefaultTimeout(PATIENCE);
const page = browser.pages()[0] ?? (await browser.newPage());
// What the driver of the software renderer says of its own speed is no message of the page.
const isOurs = (text) => !/GPU stall due to ReadPixels|GL Driver Message/.test(text);
function watch(page) {
  page.on('console', (message) => {
    if (['error', 'warning'].includes(message.type()) && isOurs(message.text())) messages.push(`${message.type()}: ${message.text()}`);
  });
  page.on('pageerror', (error) => messages.push(`exception: ${error.message}`));
  page.on('requestfailed', (request) => messages.push(`not loaded: ${request.url()}`));
  page.on('response', (response) => {
    if (response.status() >= 400) messages.push(`${response.status()}: ${response.url()}`);
  });
}
watch(page);

async function step(name, act) {
  const began = performance.now();
  try {
    const details = await act();
    assert.deepEqual(messages, [], 'messages of the console');
    console.log(`ok    ${name}${details ? `: ${details}` : ''} (${((performance.now() - began) / 1_000).toFixed(1)} s)`);
  } catch (error) {
    await page.screenshot({ path: 'failed.png' }).catch(() => {});
    console.log(`FAILED ${name}: ${error.stack}`);
    await end(1);
  }
}

async function end(code) {
  await browser.close();
  rmSync(profile, { recursive: true, force: true });
  process.exit(code);
}

const text = (selector) => page.textContent(selector);
const tab = (name) => page.click(`#tab-${name}`);

/// What the page tells of a run, for tests.
async function outcome() {
  const took = page.locator('#took');
  const [steps, totals, ms, wall, memory] = await Promise.all(
    ['steps', 'totals', 'ms', 'took', 'memory'].map(async (name) => JSON.parse(await took.getAttribute(`data-${name}`))));
  return { steps, totals, ms, wall, memory };
}

/// Gives the page a file as a job, and waits for what comes of it.
async function job(name, body) {
  await page.evaluate(() => document.getElementById('result').replaceChildren());
  await page.setInputFiles('#file', { name, mimeType: 'text/plain', buffer: Buffer.from(body) });
  await page.waitForSelector('#verdict', { timeout: LONG.seconds * 1_000 });
}

async function example(file) {
  await page.evaluate(() => document.getElementById('result').replaceChildren());
  await page.selectOption('#example', '');
  await page.selectOption('#example', file);
  await page.waitForSelector('#verdict');
}

/// Types a line into the terminal and waits for a line that is heard.
async function type(line, heard) {
  const before = await page.locator('#log > div').count();
  await page.fill('#line', line);
  await page.press('#line', 'Enter');
  await page.waitForFunction(
    ([before, heard]) => [...document.querySelectorAll('#log > div')].slice(before + 1).some((row) => row.textContent.includes(heard)), [before, heard]);
}

const shows = (selector, wanted) =>
  page.waitForFunction(([selector, wanted]) => new RegExp(wanted).test(document.querySelector(selector).textContent), [selector, wanted],
    // Frames may not come while a page has nothing to draw.
    { polling: 100 });

const steps = async () => (await text('#dro-steps')).split(' ').map(Number);

await step('the page loads, and a machine boots in it', async () => {
  await page.goto(address);
  await page.waitForSelector('html[data-ready]');
  await shows('#link-state', 'ready');
  return text('#about');
});

for (const file of reports) {
  const name = `${path.basename(file, '.json')}.gcode`;
  await step(`${name} ends at the steps of the simulated chip`, async () => {
    const report = JSON.parse(readFileSync(file, 'utf8'));
    await example(name);
    const { steps, totals, ms, wall } = await outcome();
    assert.deepEqual(steps, report.motors.map((motor) => motor.steps));
    assert.deepEqual(totals, report.motors.map((motor) => motor.total));
    const seconds = report.seconds_to_idle;
    assert.ok(Math.abs(ms / 1_000 - seconds) < 0.1 + seconds * 0.01, `${ms} ms here, ${seconds} s there`);
    assert.match(await text('#verdict'), /^All /);
    return `${steps.join(', ')}; ${totals.join(', ')} in all; ${(ms / wall).toFixed(0)} times real time`;
  });
}

await step('the path is drawn, and the time bar moves tool and numbers', async () => {
  const inked = await page.evaluate(async () => {
    await new Promise((resolve) => requestAnimationFrame(() => requestAnimationFrame(resolve)));
    const canvas = document.getElementById('canvas');
    const copy = new OffscreenCanvas(canvas.width, canvas.height).getContext('2d');
    copy.drawImage(canvas, 0, 0);
    const { data } = copy.getImageData(0, 0, canvas.width, canvas.height);
    let count = 0;
    for (let i = 0; i < data.length; i += 4) {
      const [low, high] = [Math.min(data[i], data[i + 1], data[i + 2]), Math.max(data[i], data[i + 1], data[i + 2])];
      if (data[i + 3] > 200 && high - low > 60) count += 1;
    }
    return count;
  });
  assert.ok(inked > 2_000, `${inked} coloured pixels`);
  const before = await text('#at-x');
  await page.locator('#scrub').focus();
  await page.evaluate(() => {
    const scrub = document.getElementById('scrub');
    scrub.value = scrub.max / 3;
    scrub.dispatchEvent(new Event('input'));
  });
  assert.notEqual(await text('#at-x'), before);
  assert.ok(Number((await text('#at-v')).replace(/\D/g, '')) > 50, 'it moves there');
  await page.screenshot({ path: 'job.png' });
  return `${inked} coloured pixels`;
});

await step('a refused line is shown with code, text and place, and a limit with its lines', async () => {
  await job('wrong.gcode', 'G21 G90\nG1 X5 F500\nG1 X10 F9000\nG6\nX=3\nG0 X0\n');
  assert.match(await text('#verdict'), /^2 of 6 lines refused/);
  const found = await text('#findings');
  assert.match(found, /Line 4: 131 .*G6/);
  assert.match(found, /Line 5: \d+ .*X=3/);
  assert.match(found, /Slower than asked: 1 line.*Line 3 asks for up to 9 000 mm\/min. X allows as little as 800/);
  await job('far.gcode', 'G21 G90\nG0 X200\n');
  assert.match(await text('#findings'), /X goes beyond the travel/);
});

await step('a long job can be cancelled', async () => {
  const lines = Array.from({ length: 400_000 }, (_, n) => `G1 X${(n % 50).toFixed(1)} F800`);
  await page.evaluate(() => document.getElementById('result').replaceChildren());
  await page.setInputFiles('#file', { name: 'endless.gcode', mimeType: 'text/plain', buffer: Buffer.from(lines.join('\n')) });
  await page.waitForFunction(() => document.getElementById('progress').value > 0);
  await page.click('#cancel');
  await shows('#result', 'Cancelled');
});

await step(`a job of ${LONG.lines} lines`, async () => {
  const lines = ['G21 G90 F1200'];
  for (let n = 0; n < LONG.lines - 2; n++) {
    const [turn, radius] = [(n * Math.PI * 2) / 400, 5 + (n % 8_000) / 250];
    lines.push(`G1 X${(50 + radius * Math.cos(turn)).toFixed(3)} Y${(50 + radius * Math.sin(turn)).toFixed(3)}`);
  }
  const heard = job('long.gcode', `${lines.join('\n')}\nM2\n`);
  // The page answers meanwhile.
  let slowest = 0;
  let done = false;
  heard.finally(() => (done = true)).catch(() => {});
  while (!done) {
    const began = performance.now();
    await page.evaluate(() => document.getElementById('progress').value);
    slowest = Math.max(slowest, performance.now() - began);
    await new Promise((resolve) => setTimeout(resolve, 50));
  }
  await heard;
  const { ms, wall, memory } = await outcome();
  assert.match(await text('#verdict'), /^All 100 000 lines/);
  assert.ok(wall < LONG.seconds * 1_000, `${wall} ms`);
  assert.ok(memory < LONG.megabytes * 1e6, `${memory} bytes`);
  await page.screenshot({ path: 'long.png' });
  return `${(ms / 60_000).toFixed(0)} min of machine time in ${(wall / 1_000).toFixed(1)} s, ${(memory / 1e6).toFixed(0)} MB; the page answered within ${slowest.toFixed(0)} ms`;
});

await step('a machine holds and resumes', async () => {
  await tab('machine');
  await type('g1 x20 f800', '"f":[1,0');
  await shows('#dro-state', '^runs');
  await page.click('#do-hold');
  await shows('#dro-state', '^holds');
  await page.waitForTimeout(300);
  const held = await steps();
  await page.waitForTimeout(300);
  assert.deepEqual(await steps(), held, 'it stands still');
  assert.ok(held[0] > 0 && held[0] < 25_600, `held at ${held}`);
  await page.click('#do-resume');
  await shows('#dro-state', '^at rest');
  await shows('#dro-steps', '^25600 ');
  await shows('#dro-x', '^20\\.000');
  return `held at ${held[0]} of 25600 steps`;
});

await step('flush, override, jog by key, switches, alarm, reset', async () => {
  await page.selectOption('#speed', '10');
  await type('g1 x0 f100', '"f":[1,0');
  await page.click('#do-hold');
  await shows('#dro-state', '^holds');
  await page.click('#do-flush');
  await shows('#dro-state', '^at rest');
  const left = (await steps())[0];
  assert.ok(left > 0, 'the rest of the move is dropped');
  await page.fill('#over-mfo', '150');
  await shows('#log', '"mfo":1.5');
  await page.locator('#jog button').first().focus();
  await page.keyboard.press('ArrowUp');
  await page.waitForFunction(() => Number(document.getElementById('dro-y').textContent) === 1);
  await page.click('#contacts [data-input="10"]');
  await type('{est:1}', '"est":1');
  await page.click('#contacts [data-input="10"]');
  await page.click('#contacts [data-input="10"]');
  await shows('#link-state', 'stopped');
  await page.click('#contacts [data-input="10"]');
  await type('{est:0}', '"est":0');
  await page.click('#do-reset');
  await shows('#link-state', 'ready');
  await shows('#dro-steps', '^0 0 0$');
});

await step('homing finds the switches, probing the plate', async () => {
  await type('{home:1}', '"home"');
  await shows('#dro-state', '^homes');
  await shows('#dro-state', '^at rest');
  await type('{hom:n}', '"z":1');
  await type('g38.2 z-60 f400', '"prb":{"e":1');
  await page.screenshot({ path: 'machine.png' });
});

await step('a spindle stalls in a thread', async () => {
  await page.selectOption('#speed', '1');
  await page.click('#encoder');
  await shows('#log', '"spn":16');
  await type('m3 s240 g4 p1', '"f":[1,0');
  await shows('#outputs', 'spindle');
  await page.waitForTimeout(1_500);
  await type('{sps:n}', '"sps":240');
  await type('g91 g33 z-20 k1', '"f":[1,0');
  // It waits for the spindle before it cuts.
  const [, , depth] = await steps();
  await page.waitForFunction((depth) => Number(document.getElementById('dro-steps').textContent.split(' ')[2]) < depth - 640, depth);
  await page.click('#stall');
  await shows('#link-state', 'alarm');
  await page.click('#stall');
  await page.click('#do-clear-alarm');
  await type('m5 g90', '"f":[1,0');
  // An image without threads has no such setting.
  await type('{spn:0}', '"spn":0');
  await page.selectOption('#speed', '10');
});

await step('grbl’s dialect', async () => {
  await page.selectOption('#dialect', 'grbl');
  await shows('#dro-state', '^Idle');
  await type('$I', '[VER:');
  await type('g1 x5 f600', 'ok');
  await page.waitForFunction(() => document.getElementById('dro-x').textContent === '5.000');
  await page.selectOption('#dialect', 'tinyg');
  await shows('#link-state', 'ready');
});

await step('a job is sent to the machine', async () => {
  await tab('job');
  await example('square.gcode');
  const { steps: planned } = await outcome();
  await page.click('#send-job');
  await shows('#job-text', 'All lines are with the machine');
  await shows('#dro-state', '^program ended');
  await shows('#dro-steps', `^${planned.slice(0, 3).join(' ')}$`);
});

await step('a job is written to the card, listed, run and deleted', async () => {
  await tab('machine');
  const before = await steps();
  await page.click('#card-write');
  await shows('#card-text', 'SQUARE.GCO has been written');
  assert.deepEqual(await steps(), before, 'nothing moves while it is written');
  assert.match(await text('#card-files'), /SQUARE\.GCO, [\d,.\s]+ bytes/);
  await page.click('[aria-label="Run SQUARE.GCO"]');
  await shows('#card-text', 'SQUARE.GCO runs');
  await shows('#log', 'End of file');
  assert.deepEqual(await steps(), before, 'it ends where it ended before');
  await page.click('#card-list');
  await page.click('[aria-label="Delete SQUARE.GCO"]');
  await shows('#card-text', '^0 files');
});

await step('a refused line ends a job that is sent, and what is typed meanwhile does not disturb it', async () => {
  await tab('job');
  await job('refused.gcode', `G91\n${'G1 X.1 F600\n'.repeat(40)}G6\n${'G1 X9\n'.repeat(40)}`);
  await tab('machine');
  await page.selectOption('#speed', '1');
  await tab('job');
  await page.click('#send-job');
  await type('{mfo:0.9}', '"mfo":0.9');
  await type('$xvm', 'velocity maximum');
  await shows('#job-text', 'ended early: line 42 was refused with 131');
  assert.match(await text('#log'), /line 42: 131/);
  await page.selectOption('#speed', '10');
  await type('{mfo:1}', '"mfo":1');
  await type('G90', '"f":[1,0');
});

await step('settings are a form, and a file that both sides understand', async () => {
  await tab('settings');
  await page.waitForSelector('#set-xvm');
  await page.fill('#set-xvm', '1234');
  await page.press('#set-xvm', 'Enter');
  await page.waitForFunction(() => document.querySelector('.setting.changed #set-xvm'));
  await page.fill('#set-xjd', '-1');
  await page.press('#set-xjd', 'Enter');
  await page.waitForSelector('#set-xjd-refusal:not([hidden])');
  const fetched = async (button) => {
    const [download] = await Promise.all([page.waitForEvent('download'), page.click(button)]);
    return readFileSync(await download.path(), 'utf8');
  };
  const file = await fetched('#export');
  assert.equal(JSON.parse(file).x.vm, 1234);
  const lines = await fetched('#export-lines');
  assert.ok(lines.split('\n').every((line) => line === '' || (/^\{.*\}$/.test(line) && line.length <= 200)), lines);
  writeFileSync('exported.txt', lines);
  // A new machine takes the file, and a dry run goes by it.
  await page.reload();
  await page.waitForSelector('html[data-ready]');
  await shows('#link-state', 'ready');
  await tab('settings');
  await page.waitForFunction(() => document.getElementById('set-xvm')?.value === '800');
  await page.setInputFiles('#settings-file', { name: 'mine.json', mimeType: 'application/json', buffer: Buffer.from(file) });
  await shows('#settings-told', 'is on the machine');
  await page.waitForFunction(() => document.getElementById('set-xvm').value === '1234');
  await page.screenshot({ path: 'settings.png' });
  await tab('job');
  await job('fast.gcode', 'G0 X100\n');
  assert.match(await text('#result'), /1 23\d mm\/min/);
});

await step('a profile changes the machine', async () => {
  await tab('machine');
  await page.selectOption('#profile', { index: 1 });
  await shows('#log', '"mch":1');
  await tab('settings');
  await page.waitForFunction(() => document.getElementById('set-xvm')?.value === '5000');
});

/// A serial port with the firmware behind it, in the place of the browser's, ten times as fast as a board.
///
/// With `isClock` time in the page is that of the board, which runs as fast as the computer can: a timer of the page ends
/// when the board's time has come (or in its own time, which is later). From `silentMs` behind the first reset on nothing
/// comes from the board.
function fakeSerial({ isClock = false, silentMs = Infinity } = {}) {
  let ms = 0;
  let silentFrom = Infinity;
  let isDriven = true;
  const timers = new Map();
  const later = window.setTimeout.bind(window);
  const end = (id) => {
    const act = timers.get(id)?.act;
    timers.delete(id);
    act?.();
  };
  if (isClock) {
    performance.now = () => ms;
    window.clearTimeout = (id) => timers.delete(id);
    window.setTimeout = (act, after = 0, ...rest) => {
      const id = later(() => end(id), after);
      timers.set(id, { until: ms + after, act: () => act(...rest) });
      return id;
    };
  }
  const start = (eeprom, asked) => {
    window.board = new window.Firmware(window.module);
    window.board.boot(eeprom, asked);
  };
  /// Lets time pass, and gives what the board has sent to the page.
  const pass = (by, controller) => {
    ms += by;
    window.board.run(by);
    const heard = window.board.heard();
    if (heard && ms < silentFrom) controller.enqueue(Uint8Array.from(heard, (c) => c.charCodeAt(0)));
    if (window.board.state().reset) start(window.board.eeprom(), true);
    for (const [id, { until }] of timers) if (until <= ms) end(id);
  };
  /// Calls `act` again and again, and leaves time for the page's own work. Returns what ends that.
  const repeat = (act) => {
    if (!isClock) {
      const timer = setInterval(() => act(100), 10);
      return () => clearInterval(timer);
    }
    const { port1, port2 } = new MessageChannel();
    port2.onmessage = () => {
      port1.postMessage('');
      act(5);
    };
    port1.postMessage('');
    return () => port2.close();
  };
  const port = {
    async open() {
      const [{ Firmware }, module] = await Promise.all([import('/firmware.js'), WebAssembly.compileStreaming(fetch('/kerf.wasm'))]);
      Object.assign(window, { Firmware, module });
      start();
      let cancel;
      this.readable = new ReadableStream({
        start: (controller) => (cancel = repeat((by) => pass(by, controller))),
        cancel: () => cancel(),
      });
      this.writable = new WritableStream({ write: (bytes) => window.board.send(bytes) });
    },
    /// A board resets when its reset line is driven.
    async setSignals({ dataTerminalReady }) {
      if (dataTerminalReady && !isDriven) {
        silentFrom = Math.min(silentFrom, ms + silentMs);
        start(window.board.eeprom());
      }
      isDriven = dataTerminalReady;
    },
    getInfo: () => ({ usbVendorId: 0x2341 }),
    async close() {},
  };
  Object.defineProperty(navigator, 'serial', { value: { requestPort: async () => port }, configurable: true });
}

/// Opens the page once more with a board that is its clock, checks the board, and returns the new page.
async function checkedPage(options) {
  const other = await browser.newPage();
  watch(other);
  await other.addInitScript(fakeSerial, { ...options, isClock: true });
  await other.goto(address);
  await other.waitForSelector('html[data-ready]');
  assert.ok(await other.isHidden('#check'), 'a simulated board is not checked');
  await other.click('#connect');
  await other.click('#check');
  assert.match(await other.textContent('#checking'), /Switch the motors’ supply off/);
  await other.click('#check-start');
  await other.waitForSelector('#check-save');
  return other;
}

async function report(other) {
  const [download] = await Promise.all([other.waitForEvent('download'), other.click('#check-save')]);
  assert.equal(download.suggestedFilename(), 'kerf-verify.md');
  return readFileSync(await download.path(), 'utf8');
}

await step('a board behind Web Serial: terminal, settings, a job', async () => {
  await page.addInitScript(fakeSerial);
  await page.reload();
  await page.waitForSelector('html[data-ready]');
  await example('square.gcode');
  await page.click('#connect');
  await shows('#link-state', '^Real board: ready');
  await type('{yvm:700}', '"yvm":700');
  await tab('job');
  await page.click('#send-job');
  await shows('#job-text', 'All lines are with the machine');
  await shows('#link-state', 'program ended');
  assert.deepEqual(await page.evaluate(() => window.board.state().steps), [0, 0, 2_560, 0]);
  await tab('settings');
  await page.selectOption('#group', 'y');
  await page.waitForFunction(() => document.getElementById('set-yvm')?.value === '700');
  await page.click('#connect');
  await shows('#link-state', '^Simulated: ready');
});

await step('a real board is checked and found sound', async () => {
  const other = await checkedPage();
  const verdict = await other.textContent('#check-verdict');
  assert.match(verdict, /checks passed/);
  assert.match(await other.textContent('#check-limits'), /Only Kerf itself.*cargo xtask verify/);
  const file = await report(other);
  assert.match(file, /settings through a reset \| ok/);
  assert.match(file, /clock of Kerf \| ok/);
  assert.match(file, /\| job \| ok/);
  assert.match(file, /RAM \| not tried/);
  await other.addScriptTag({ path: require.resolve('axe-core/axe.min.js') });
  const { violations } = await other.evaluate(() => window.axe.run());
  assert.deepEqual(violations.map(({ id, nodes }) => `${id}: ${nodes.map(({ target }) => target)}`), []);
  await other.screenshot({ path: 'checked.png' });
  // The board is the terminal's again.
  await other.click('#check-close');
  await other.fill('#line', '{fv:n}');
  await other.press('#line', 'Enter');
  await other.waitForSelector('#log >> text="fv":');
  await other.close();
  return verdict;
});

await step('a board that falls silent in a check has a finding', async () => {
  const other = await checkedPage({ silentMs: 12_000 });
  const verdict = await other.textContent('#check-verdict');
  assert.match(verdict, /^1 of .* FAILED/);
  assert.match(await report(other), /FAILED \| .*no answer within/);
  await other.close();
  return verdict;
});

await step('a check that is stopped ends at once', async () => {
  const other = await browser.newPage();
  watch(other);
  await other.addInitScript(fakeSerial);
  await other.goto(address);
  await other.waitForSelector('html[data-ready]');
  await other.click('#connect');
  await other.click('#check');
  await other.click('#check-start');
  await other.click('#check-stop');
  await other.waitForSelector('#check-save', { timeout: 2_000 });
  assert.match(await report(other), /FAILED \| `stopped by the person/);
  await other.close();
});

await step('a keyboard reaches everything, and axe finds nothing', async () => {
  await page.addScriptTag({ path: require.resolve('axe-core/axe.min.js') });
  for (const scheme of ['light', 'dark']) {
    await page.emulateMedia({ colorScheme: scheme });
    for (const name of ['job', 'machine', 'settings']) {
      await tab(name);
      await page.waitForTimeout(250);
      const { violations } = await page.evaluate(() => window.axe.run());
      const told = violations.map(({ id, nodes }) => `${scheme} ${name}: ${id}: ${nodes.map((node) => `${node.target} ${node.failureSummary}`).join('\n   ')}`);
      assert.deepEqual(told, []);
    }
    await page.screenshot({ path: `${scheme}.png` });
  }
  await page.locator('#tab-settings').focus();
  await page.keyboard.press('ArrowRight');
  assert.equal(await page.getAttribute('#tab-job', 'aria-selected'), 'true');
});

await step('it can be looked at on a phone', async () => {
  await page.setViewportSize({ width: 390, height: 844 });
  await page.waitForTimeout(300);
  const wide = await page.evaluate(() => document.documentElement.scrollWidth);
  assert.ok(wide <= 390, `${wide} pixels wide`);
  await page.screenshot({ path: 'phone.png' });
});

console.log('the page: all steps passed');
await end(0);
