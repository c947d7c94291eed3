// Sends a job by counting responses: at most four lines, and no more bytes than the machine has room for, wait for an
// answer.
//
// Used for a simulated machine and for a real one. Owned by the code that has the line. It never waits, and has no
// clock, so it does not notice a machine that has stopped answering. `stop` drops what has not been sent. A strict
// sender stops at the first refused line and at an alarm. `foreign` reports lines that the user types meanwhile, so
// that their answers are not counted for the job.

/// Exceptions after which a job continues.
export const HARMLESS = [37, 38, 39, 40, 180];

import { answerStatus, exceptionStatus, isText, nameIn, parse, ALARM, PASSED_OVER } from './protocol.js';

/// Most lines that may wait for their answers, and their bytes together. The machine has room for 587 bytes.
const IN_FLIGHT = 4;
const BYTES = 500;

/// The lines of a job as they are sent: `{ number, text, left }`. `left` is true if characters that would act at once
/// were removed.
export function* linesOf(job) {
  let number = 0;
  for (const raw of job.split('\n')) {
    number += 1;
    const line = raw.trim();
    if (line === '' || line.startsWith('%')) continue;
    const text = line.replace(/[^\x20-\x7e]/g, ' ').replace(/[!~%]/g, '').trimEnd();
    yield { number, text, left: /[!~%]/.test(line) };
  }
}

/// Whether a line homes.
export function homes(text) {
  return /G28\.[24]/i.test(text.replace(/\s/g, ''));
}

export class Sender {
  #lines;
  #waiting = [];
  #bytes = 0;
  #next;
  #again = [];
  #foreign = [];
  #prompts = 0;

  /// `lines` are those of `linesOf`. `total` is used only for the progress.
  constructor(lines, total, strict = false) {
    this.strict = strict;
    /// The reason why a strict sender has stopped.
    this.stopped = '';
    this.#lines = lines[Symbol.iterator]();
    this.total = total;
    this.answered = 0;
    this.sent = 0;
    /// The number of the last line that was answered.
    this.last = 0;
    this.refused = [];
    this.notes = [];
    this.#advance();
  }

  #advance() {
    const { done, value } = this.#lines.next();
    this.#next = done ? undefined : value;
  }

  /// Queues a line that was refused in an alarm, to be sent once more after the alarm has been cleared, before all other
  /// lines.
  #retry(line) {
    this.#again.push({ ...line, again: true, left: false });
    this.answered -= 1;
    return true;
  }

  /// Returns the text that may be sent now, with line ends; empty if no more may be sent.
  take() {
    let text = '';
    for (let line = this.#peek(); line && this.#fits(line); line = this.#peek()) {
      if (this.#again.length > 0) this.#again.shift();
      else this.#advance();
      text += `${line.text}\n`;
      this.#waiting.push(line);
      this.#bytes += line.text.length + 1;
      this.sent += 1;
      if (line.left) this.notes.push({ line: line.number, text: 'A character that would act at once was left out.' });
    }
    return text;
  }

  #peek() {
    return this.#again[0] ?? this.#next;
  }

  #fits(line) {
    const first = this.#waiting.length === 0;
    return first || (this.#waiting.length < IN_FLIGHT && this.#bytes + line.text.length + 1 <= BYTES);
  }

  /// Takes note of a line that was not sent by this sender.
  foreign(line) {
    const name = nameIn(line);
    if (name !== undefined) this.#foreign.push(name);
    else if (isText(line)) this.#prompts += 1;
    else if (line.trim() !== '') {
      this.#waiting.push({ number: this.last, text: line });
      this.#bytes += line.length + 1;
    }
  }

  /// Whether an answer belongs to such a line.
  #isForeign(line) {
    const body = parse(line)?.r;
    const at = body ? this.#foreign.findIndex((name) => name in body) : -1;
    if (at >= 0) this.#foreign.splice(at, 1);
    const prompt = !body && this.#prompts > 0;
    if (prompt) this.#prompts -= 1;
    return at >= 0 || prompt;
  }

  #stopAt(why) {
    if (!this.strict || this.stopped) return;
    this.stopped = why;
    this.stop();
  }

  /// Takes a line from the machine. Returns true if the line answers a line of the job.
  hear(heard) {
    const exception = exceptionStatus(heard);
    if (exception !== undefined) {
      this.notes.push({ line: this.last, status: exception });
      if (!HARMLESS.includes(exception)) this.#stopAt(`exception ${exception} after line ${this.last}`);
    }
    const status = answerStatus(heard);
    if (status === undefined || this.#isForeign(heard) || this.#waiting.length === 0) return false;
    const line = this.#waiting.shift();
    const { number, text } = line;
    this.#bytes -= text.length + 1;
    this.answered += 1;
    this.last = number;
    if (status === 0 || status === PASSED_OVER) return true;
    if (status === ALARM && !this.strict && !line.again) return this.#retry(line);
    if (status !== ALARM || line.again) this.refused.push({ line: number, text, status });
    this.#stopAt(`line ${number} was refused with ${status}`);
    return true;
  }

  /// Stops sending.
  stop() {
    this.#again = [];
    this.#next = undefined;
  }

  /// Whether every line has been answered.
  get done() {
    return !this.#peek() && this.#waiting.length === 0;
  }
}
