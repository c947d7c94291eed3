// Sends a job safely, by counting responses: at most four lines, and no more bytes than the machine has room for, wait for an answer.
//
// The same for a simulated machine and a real one. Owned by whoever has the line; it never waits, and keeps no clock. A machine that
// answers no more leaves it where it is; `stop` forgets what has not been sent.

import { answerStatus, exceptionStatus, ALARM, PASSED_OVER } from './protocol.js';

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
    const text = line.replace(/[^\x20-\x7e]/g, ' ').replace(/[!~%]/g, '');
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

  /// `lines` are those of `linesOf`; `total` is for the progress alone.
  constructor(lines, total) {
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

  /// The text that may be sent now, with its line ends; empty if the machine has enough.
  take() {
    let text = '';
    while (this.#next && this.#waiting.length < IN_FLIGHT) {
      const size = this.#next.text.length + 1;
      if (this.#waiting.length > 0 && this.#bytes + size > BYTES) break;
      text += `${this.#next.text}\n`;
      this.#waiting.push(this.#next);
      this.#bytes += size;
      this.sent += 1;
      if (this.#next.left) this.notes.push({ line: this.#next.number, text: 'A character that would act at once was left out.' });
      this.#advance();
    }
    return text;
  }

  /// A line from the machine. True if it is the answer to a line of the job.
  hear(line) {
    const exception = exceptionStatus(line);
    if (exception !== undefined) this.notes.push({ line: this.last, status: exception });
    const status = answerStatus(line);
    if (status === undefined || this.#waiting.length === 0) return false;
    const { number, text } = this.#waiting.shift();
    this.#bytes -= text.length + 1;
    this.answered += 1;
    this.last = number;
    if (status !== 0 && status !== PASSED_OVER && status !== ALARM) this.refused.push({ line: number, text, status });
    return true;
  }

  /// Nothing more is sent.
  stop() {
    this.#next = undefined;
  }

  /// Whether every line has been answered.
  get done() {
    return !this.#next && this.#waiting.length === 0;
  }
}
