// Sends a job safely, by counting responses: at most four lines, and no more bytes than the machine has room for, wait for an answer.
//
// The same for a simulated machine and a real one. Owned by whoever has the line; it never waits, and keeps no clock. A machine that
// answers no more leaves it where it is; `stop` forgets what has not been sent. A strict one stops at the first line that is refused, and at an
// alarm. What somebody types meanwhile is told by `foreign`, so that its answer is not taken for one of the job's.

/// Exceptions after which a job goes on.
export const HARMLESS = [37, 38, 39, 40, 180];

import { answerStatus, exceptionStatus, isText, nameIn, parse, ALARM, PASSED_OVER } from './protocol.js';

/// Lines that may wait for their answers, and their bytes together: 587 fit the machine.
const IN_FLIGHT = 4;
const BYTES = 500;

/// The lines of a job as they are sent: `{ number, text, left }`, where `left` are characters that would act at once and were left out.
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

  /// `lines` are those of `linesOf`; `total` is for the progress alone.
  constructor(lines, total, strict = false) {
    this.strict = strict;
    /// Why a strict one has stopped.
    this.stopped = '';
    this.#lines = lines[Symbol.iterator]();
    this.total = total;
    this.answered = 0;
    this.sent = 0;
    /// The number of the line that was answered last.
    this.last = 0;
    this.refused = [];
    this.notes = [];
    this.#advance();
  }

  #advance() {
    const { done, value } = this.#lines.next();
    this.#next = done ? undefined : value;
  }

  /// A line that an alarm has refused is sent once more, before all others, when the alarm has been cleared.
  #retry(line) {
    this.#again.push({ ...line, again: true, left: false });
    this.answered -= 1;
    return true;
  }

  /// The text that may be sent now, with its line ends; empty if the machine has enough.
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

  /// Somebody else has sent a line.
  foreign(line) {
    const name = nameIn(line);
    if (name !== undefined) this.#foreign.push(name);
    else if (isText(line)) this.#prompts += 1;
    else if (line.trim() !== '') {
      this.#waiting.push({ number: this.last, text: line });
      this.#bytes += line.length + 1;
    }
  }

  /// Whether an answer is that to a foreign line.
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

  /// A line from the machine. True if it is the answer to a line of the job.
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

  /// Nothing more is sent.
  stop() {
    this.#again = [];
    this.#next = undefined;
  }

  /// Whether every line has been answered.
  get done() {
    return !this.#peek() && this.#waiting.length === 0;
  }
}
