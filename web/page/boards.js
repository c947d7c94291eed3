// The machine that the page is connected to: a simulated one in a Worker, or a real one behind Web Serial. Both have
// the same interface.
//
// | member | meaning |
// |---|---|
// | `send(text)` | sends characters unchanged |
// | `ask(line)` | sends a line; its answer as `{ body, status }`, one question at a time |
// | `stream(job)`, `stopStream()` | sends a job by counting responses; stops sending |
// | events | `line` (`{ line, asked }`: whether it answers `ask`), `sent`, `state`, `trail`, `booted`, `progress`, `streamed`, `closed` |
//
// An answer belongs to the oldest question whose name it contains. While a job is sent, all answers belong to the job,
// and `ask` is an error.

import { Lines, answerStatus, isText, nameIn, parse } from './protocol.js';
import { Sender, linesOf } from './sender.js';

/// Time for which a board's reset line is released, so that it resets when the line is driven again, ms.
const PULSE_MS = 50;
/// Longest wait for an answer, ms of the computer's time.
const ANSWER_MS = 4_000;

class Board extends EventTarget {
  #lines = new Lines();
  #asked = [];
  streaming = false;
  /// The dialect of the page's first line, which decides the dialect of the port: `tinyg` or `grbl`.
  dialect = 'tinyg';

  tell(name, detail) {
    this.dispatchEvent(new CustomEvent(name, { detail }));
  }

  on(name, act) {
    this.addEventListener(name, ({ detail }) => act(detail));
  }

  /// Takes characters from the machine.
  hear(text) {
    for (const line of this.#lines.add(text)) {
      const waits = this.streaming ? undefined : this.#questionOf(line);
      this.tell('line', { line, asked: Boolean(waits) });
      waits?.hear(line);
    }
  }

  #questionOf(line) {
    const body = answerStatus(line) === undefined ? undefined : parse(line)?.r;
    const at = body ? this.#asked.findIndex(({ name }) => name in body) : -1;
    return at < 0 ? undefined : this.#asked.splice(at, 1)[0];
  }

  /// Sends a line that the user has typed.
  type(line) {
    this.tell('sent', line);
    this.sendLine(line);
    // Answers in text mode have no status. A question in JSON makes the answers to the job JSON again.
    if (this.streaming && this.dialect === 'tinyg' && isText(line)) this.sendLine('{qr:n}');
  }

  /// Sends a job. Throws if the machine does not answer in a way by which lines can be counted.
  async stream(job) {
    // After a question in JSON the answers are JSON.
    if (this.dialect === 'tinyg') await this.ask('{qr:n}');
    this.streaming = true;
    this.begin(job);
  }

  ask(line) {
    const answer = new Promise((resolve, reject) => {
      if (this.streaming) return reject(new Error('a job is being sent'));
      if (this.isLent) return reject(new Error('the board is being checked'));
      const late = setTimeout(() => {
        this.#asked = [];
        reject(new Error(`no answer to ${line}`));
      }, ANSWER_MS);
      const hear = (heard) => {
        clearTimeout(late);
        resolve({ body: parse(heard).r, status: answerStatus(heard) });
      };
      this.#asked.push({ name: nameIn(line), hear });
    });
    this.send(`${line}\n`);
    return answer;
  }

  /// Drops all waits for answers.
  forget() {
    this.#asked = [];
    this.#lines = new Lines();
  }
}

/// The firmware in a Worker.
export class SimulatedBoard extends Board {
  name = 'Simulated';
  simulated = true;
  #worker;
  #snapshots = new Map();
  #count = 0;

  constructor(module) {
    super();
    this.#worker = new Worker(new URL('./machine-worker.js', import.meta.url), { type: 'module' });
    this.#worker.onmessage = ({ data }) => this.#told(data);
    this.#worker.postMessage({ module });
  }

  #told(data) {
    if ('heard' in data) {
      if (data.port === 0) this.hear(data.heard);
    } else if ('snapshot' in data) {
      this.#snapshots.get(data.snapshot)?.(data.eeprom);
      this.#snapshots.delete(data.snapshot);
    } else if ('booted' in data) {
      this.forget();
      this.tell('booted');
    } else if ('streamed' in data) {
      this.streaming = false;
      this.tell('streamed', data.streamed);
    } else {
      for (const name of ['state', 'trail', 'progress']) if (name in data) this.tell(name, data[name]);
    }
  }

  send(text) {
    this.#worker.postMessage({ send: text });
  }

  sendLine(line) {
    this.#worker.postMessage({ line });
  }

  begin(job) {
    this.#worker.postMessage({ stream: job });
  }

  stopStream() {
    this.#worker.postMessage({ stopStream: true });
  }

  /// Returns the EEPROM contents, once everything is stored.
  eeprom() {
    const id = (this.#count += 1);
    return new Promise((resolve) => {
      this.#snapshots.set(id, resolve);
      this.#worker.postMessage({ snapshot: id });
    });
  }

  /// Switches the machine off and on. Stored values stay.
  power() {
    this.#worker.postMessage({ power: true });
  }

  set speed(speed) {
    this.#worker.postMessage({ speed });
  }

  press(input, closed) {
    this.#worker.postMessage({ press: input, closed });
  }

  near(input, step) {
    this.#worker.postMessage({ near: [input, step] });
  }

  turnSpindle(rpm, perTurn) {
    this.#worker.postMessage({ spindle: { rpm, perTurn } });
  }

  close() {
    this.#worker.terminate();
    this.tell('closed');
  }
}

/// Longest time from TinyG's greeting to that of grbl on the same port.
const SECOND_GREETING_MS = 500;

/// A real board behind Web Serial.
export class SerialBoard extends Board {
  name = 'Real board';
  simulated = false;
  #port;
  #writer;
  #reader;
  #sender;
  #borrower;
  /// The dialect of the last greeting: `tinyg` or `grbl`. A port whose dialect is open greets in both, grbl's last,
  /// and the page speaks TinyG's there.
  greeted;
  #readyAt = 0;

  /// Asks the user for a port and opens it. A board resets when its port is opened.
  static async open(baudRate = 115_200) {
    const board = new SerialBoard();
    board.#port = await navigator.serial.requestPort();
    await board.#port.open({ baudRate, bufferSize: 4_096 });
    board.#writer = board.#port.writable.getWriter();
    board.#read();
    return board;
  }

  async #read() {
    const decoder = new TextDecoder('latin1');
    try {
      while (this.#port?.readable) {
        this.#reader = this.#port.readable.getReader();
        for (;;) {
          const { value, done } = await this.#reader.read();
          if (done) break;
          this.#heard(decoder.decode(value, { stream: true }));
        }
        this.#reader.releaseLock();
        break;
      }
    } catch {
      // The cable has been unplugged. The event `closed` below reports that.
    }
    this.#reader = undefined;
    this.#port = undefined;
    this.streaming = false;
    this.#borrower?.lost();
    this.tell('closed');
  }

  #jobLines = new Lines();

  #heard(text) {
    if (this.#borrower) return this.#borrower.hear(text);
    this.hear(text);
    const sender = this.#sender;
    const lines = this.#jobLines.add(text);
    const isSecond = Date.now() - this.#readyAt < SECOND_GREETING_MS;
    if (lines.some((line) => line.startsWith('Grbl ')) && !isSecond) this.greeted = 'grbl';
    if (lines.some((line) => parse(line)?.r?.msg === 'SYSTEM READY')) {
      this.greeted = 'tinyg';
      this.#readyAt = Date.now();
      this.#end('the machine has started anew');
      this.forget();
      this.tell('booted');
    }
    if (!sender || sender !== this.#sender) return;
    for (const line of lines) sender.hear(line);
    this.tell('progress', { sent: sender.last, total: sender.total });
    if (sender.done) this.#end(sender.stopped);
    else this.#feed();
  }

  #feed() {
    const text = this.#sender?.take();
    if (text) this.send(text);
  }

  #end(why) {
    if (!this.#sender) return;
    const { answered, refused, notes } = this.#sender;
    this.#sender = undefined;
    this.streaming = false;
    this.tell('streamed', { answered, refused, notes, why });
  }

  /// Nothing is sent while the port is lent.
  send(text) {
    if (!this.isLent) this.write(text);
  }

  /// Sends text or bytes, also while the port is lent.
  write(data) {
    const bytes = typeof data === 'string' ? Uint8Array.from(data, (character) => character.charCodeAt(0)) : data;
    this.#writer?.write(bytes).catch(() => {});
  }

  get isLent() {
    return Boolean(this.#borrower);
  }

  /// Lends the port to `{ hear(text), lost() }`: only `write` sends, and only the borrower hears. `undefined` ends that.
  lend(borrower) {
    this.#borrower = borrower;
    this.#jobLines = new Lines();
    this.forget();
  }

  /// Resets the board by its reset line. `act` is called right before.
  async pulse(act) {
    await this.#port.setSignals({ dataTerminalReady: false });
    await new Promise((resolve) => setTimeout(resolve, PULSE_MS));
    act();
    await this.#port.setSignals({ dataTerminalReady: true });
  }

  /// The number of the vendor of the board's USB; `undefined` if the port is no USB port.
  get vendor() {
    return this.#port?.getInfo?.().usbVendorId;
  }

  sendLine(line) {
    this.#sender?.foreign(line);
    this.send(`${line}\n`);
  }

  begin(job) {
    this.#sender = new Sender(linesOf(job), job.split('\n').length, true);
    this.#feed();
  }

  stopStream() {
    this.#sender?.stop();
    if (this.#sender?.done) this.#end('');
  }

  async close() {
    const port = this.#port;
    try {
      await this.#reader?.cancel();
      this.#writer?.releaseLock();
      await port?.close();
    } catch {
      // The port is closed already.
    }
  }
}
