// What lines from a machine mean, in TinyG's dialect and in grbl's. Pure functions.

/// Status of a line that was passed over, and of one that an alarm refused.
export const PASSED_OVER = 3;
export const ALARM = 203;

function json(text) {
  try {
    return JSON.parse(text);
  } catch {
    return undefined;
  }
}

/// A line as JSON, or nothing. With `js` 0 names have no quotes.
export function parse(line) {
  if (!line.startsWith('{')) return undefined;
  return json(line) ?? json(line.replace(/([{,])(\w+):/g, '$1"$2":'));
}

/// Status of a refusal in text mode, which tells no number.
export const UNTOLD = -1;

/// The status of the answer to a line; nothing of what answers no line: a greeting, a report, the end of a probing. In text mode a prompt answers.
export function answerStatus(line) {
  if (line === 'ok') return 0;
  const error = /^error:(\d+)/.exec(line);
  if (error) return Number(error[1]);
  const prompt = /^(?:tinyg|g2core) ?\[\w+\] (ok>|err:)/.exec(line);
  if (prompt) return prompt[1] === 'ok>' ? 0 : UNTOLD;
  const { r: body, f: footer } = parse(line) ?? {};
  if (!body || !Array.isArray(footer)) return undefined;
  if (body.msg === 'SYSTEM READY' || 'prb' in body) return undefined;
  return footer[1];
}

/// Whether a line is of text mode, in which the machine answers from then on: `$xvm`, `?`, `h`.
export function isText(line) {
  return /^\s*[$?h]/.test(line);
}

/// The status of an exception.
export function exceptionStatus(line) {
  return parse(line)?.er?.st;
}

/// The first name in a line of JSON, typed strictly or not: `xvm` of `{xvm:n}`.
export function nameIn(line) {
  return /^\s*\{\s*"?(\w+)/.exec(line)?.[1];
}

/// What `stat` numbers are.
export const STATES = ['starts', 'ready', 'alarm', 'at rest', 'program ended', 'runs', 'holds', 'probes', '', 'homes', 'jogs', 'stopped', '', 'panic'];

/// Splits a stream of characters into lines; keeps what has no end yet.
export class Lines {
  #rest = '';

  add(text) {
    const lines = (this.#rest + text).split('\n');
    this.#rest = lines.pop();
    // XON and XOFF are no part of a line.
    return lines.map((line) => line.replace(/[\r\x11\x13]/g, '')).filter((line) => line !== '');
  }
}
