// The steps of a test. Each is told in one line, which `cargo xtask senders` reads:
// `step`, `passed` or `failed` or `not yet`, its name, details; parted by tabs.

'use strict';

const tell = (result, name, details) => console.log(['step', result, name, details].join('\t'));

/// Runs a step and tells what came of it; what it returns are details for people.
/// A step that takes longer than `seconds` has failed, and with it the test.
async function step(name, seconds, run) {
  let timer;
  const late = new Promise((_, reject) => {
    timer = setTimeout(() => reject(new Error(`not done within ${seconds} s`)), seconds * 1000);
  });
  try {
    const details = await Promise.race([run(), late]);
    tell(details instanceof NotYet ? 'not yet' : 'passed', name, String(details));
  } catch (error) {
    tell('failed', name, error.message);
    throw new Failed();
  } finally {
    clearTimeout(timer);
  }
}

/// The firmware does not do this yet: returned by a step instead of its details.
class NotYet {
  constructor(why) {
    this.why = why;
  }

  toString() {
    return this.why;
  }
}

/// A step has failed and has been told.
class Failed extends Error {}

const sleep = (ms) => new Promise((resolve) => setTimeout(resolve, ms));

/// Waits until the condition holds; the step's own limit ends a wait that would never end.
async function until(condition) {
  for (;;) {
    const value = condition();
    if (value) return value;
    await sleep(5);
  }
}

/// Waits up to `ms` until the condition holds; returns whether it does.
async function within(ms, condition) {
  const end = Date.now() + ms;
  while (!condition()) {
    if (Date.now() > end) return false;
    await sleep(5);
  }
  return true;
}

function ensure(condition, text) {
  if (!condition) throw new Error(text);
}

/// Runs the test, and ends the process with what came of it. The test is given up when nobody waits for
/// it any more: then the standard input ends.
async function main(test, end) {
  const leave = async (code) => {
    await end();
    process.exit(code);
  };
  const fail = (error) => {
    if (!(error instanceof Failed)) tell('failed', 'test', String(error.stack).replace(/\s+/g, ' '));
    return leave(1);
  };
  process.on('uncaughtException', fail);
  process.stdin.on('end', () => leave(1)).resume();
  try {
    await test();
  } catch (error) {
    return fail(error);
  }
  return leave(0);
}

module.exports = { step, NotYet, sleep, until, within, ensure, main };
