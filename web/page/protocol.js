// Interprets lines from a machine, in TinyG's dialect and in grbl's. Pure functions.

/// Status of a line that was skipped, and of a line that was refused in an alarm.
export const PASSED_OVER = 3;
export const ALARM = 203;

function json(text) {
  try {
    return JSON.parse(text);
  } catch {
    return undefined;
  }
}

/// Parses a line as JSON; `undefined` if it is not JSON. With `js` 0 names have no quotes.
export function parse(line) {
  if (!line.startsWith('{')) return undefined;
  return json(line) ?? json(line.replace(/([{,])(\w+):/g, '$1"$2":'));
}

/// Status of a refusal in text mode, which has no number.
export const UNTOLD = -1;

/// Returns the status of the answer to a line; `undefined` for lines that answer no line, such as a greeting, a report
/// or the end of a probing. In text mode a prompt answers a line.
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

/// Whether a line belongs to text mode (`$xvm`, `?`, `h`). The machine answers in text mode from then on.
export function isText(line) {
  return /^\s*[$?h]/.test(line);
}

/// Returns the status of an exception.
export function exceptionStatus(line) {
  return parse(line)?.er?.st;
}

/// Returns the first name in a line of JSON, with or without quotes: `xvm` of `{xvm:n}`.
export function nameIn(line) {
  return /^\s*\{\s*"?(\w+)/.exec(line)?.[1];
}

/// The meanings of the numbers of `stat`.
export const STATES = ['starts', 'ready', 'alarm', 'at rest', 'program ended', 'runs', 'holds', 'probes', '', 'homes', 'jogs', 'stopped', '', 'panic'];

/// Splits a stream of characters into lines, and keeps the last line until its end has come.
export class Lines {
  #rest = '';

  add(text) {
    const lines = (this.#rest + text).split('\n');
    this.#rest = lines.pop();
    // XON and XOFF do not belong to a line.
    return lines.map((line) => line.replace(/[\r\x11\x13]/g, '')).filter((line) => line !== '');
  }
}
