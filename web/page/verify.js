// Checks a real board: carries out what the checks want. The checks are those of `cargo xtask verify`; they run in an
// instance of the module (`web/src/verify.rs`).
//
// A `link` is the port of a board, or a test's:
//
// | member | meaning |
// |---|---|
// | `now()` | its clock, ms |
// | `take()` | returns what has come since the last call, as text |
// | `wait(until)` | ends when something has come, at the latest at that time; may end earlier |
// | `send(bytes)`, `reset()` | |
// | `broken` | why the port does not work any more; else empty |

/// Longest time of a reset, ms.
const RESET_MS = 5_000;

const DO = {
  wait: (link, { until }) => link.wait(until),
  send: (link, { bytes }) => link.send(bytes),
  reset: (link) => link.reset(),
  tell: () => {},
};

/// Makes all checks. `tell` gets each line for the person. Returns `{ isSound, verdict, file }`.
export async function check(firmware, link, { dialect, seed, tell }) {
  firmware.verifyBegin(dialect, seed);
  for (;;) {
    if (link.broken) firmware.verifyFail(link.broken);
    const want = firmware.verifyStep(link.now(), link.take());
    if (want.kind === 'done') return want;
    if (want.kind === 'tell') tell(want.line);
    await DO[want.kind](link, want);
  }
}

/// The port of a `SerialBoard`, lent to a check. Nothing else sends until `end`.
export class Link {
  broken = '';
  #board;
  #heard = '';
  #wake = () => {};

  constructor(board) {
    this.#board = board;
    board.lend({ hear: (text) => this.#hear(text), lost: () => this.fail('the port has been closed') });
  }

  /// Gives the port back, and starts the board anew.
  async end() {
    if (!this.broken) await this.reset();
    this.#board.lend(undefined);
  }

  /// The port counts as broken from now on.
  fail(why) {
    this.broken ||= why;
    this.#wake();
  }

  #hear(text) {
    this.#heard += text;
    this.#wake();
  }

  now() {
    return performance.now();
  }

  take() {
    const heard = this.#heard;
    this.#heard = '';
    return heard;
  }

  wait(until) {
    if (this.#heard || this.broken) return undefined;
    return new Promise((resolve) => {
      const timer = setTimeout(resolve, Math.max(until - this.now(), 0));
      this.#wake = () => {
        clearTimeout(timer);
        resolve();
      };
    });
  }

  send(bytes) {
    this.#board.write(bytes);
  }

  /// Resets the board. What has come before is forgotten.
  async reset() {
    const late = new Promise((_, reject) => setTimeout(() => reject(new Error('the port takes too long')), RESET_MS));
    const done = this.#board.pulse(() => this.take());
    await Promise.race([done, late]).catch((error) => this.fail(`the board cannot be reset: ${error.message}`));
  }
}
