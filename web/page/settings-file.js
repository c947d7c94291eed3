// Saves all settings of a machine to a file, and loads them. The file is that of `cargo xtask settings save`. It can
// also be saved as lines, one request each, which any sender sends like a job, and which `cargo xtask sim --set @FILE`
// reads.
//
// Owned by the settings panel, which shows the refused settings. Sending continues after a refusal. A missing answer is
// an error.

/// The groups, in the order in which they are loaded.
export const GROUPS = ['1', '2', '3', '4', 'x', 'y', 'z', 'a', 'b', 'c', 'p1', 'sp', 'co', 'sq', 'uda', 'udb', 'udc', 'udd', 'sys'];
const SYSTEMS = ['g54', 'g55', 'g56', 'g57', 'g58', 'g59', 'g591', 'g592', 'g593'];
const TOOLS = Array.from({ length: 10 }, (_, n) => `tt${n + 1}`);
const STORED = ['g28', 'g30'];
/// Values that identify the machine. They are not sent back.
const FIXED = ['fb', 'fv', 'hp', 'hv', 'id', 'net', 'baud', 'kerf'];
/// Settings that change how the machine answers, and settings that may stop it. They are sent last.
const TALK = ['ej', 'js', 'tv', 'ec', 'ee', 'ex', 'rxm', 'sv', 'si', 'qv', 'dia', 'jv'];
const STOPPING = ['saf', 'est'];
/// Settings that images without their capability lack, with the values that are equivalent to their absence. A setting
/// with that value is left out.
const OPTIONAL = { sp: { n: 0, b: 0, r: 0, l: 0.2, di: 0 } };
/// Longest line that is sent.
const LINE = 200;

/// Reads all groups from a machine.
export async function save(board) {
  const all = {};
  for (const group of [...GROUPS, ...SYSTEMS, ...TOOLS, ...STORED]) {
    const { body, status } = await board.ask(`{${group}:n}`);
    if (status !== 0) throw new Error(`{${group}:n} is refused with status ${status}`);
    const isThere = ([name, value]) => OPTIONAL[group]?.[name] !== value;
    all[group] = Object.fromEntries(Object.entries(body[group]).filter(isThere));
  }
  return all;
}

const spelled = (value) => (typeof value === 'string' ? `"${value}"` : String(value));

/// Returns the requests that set the values of a file, in an order that the machine accepts: profile, motors, axes, the
/// rest, and last the settings that change the conversation. Stored positions cannot be set.
export function requests(file) {
  const system = Object.entries(file.sys ?? {});
  const special = [...FIXED, ...TALK, ...STOPPING, 'mch'];
  const lines = system.filter(([name]) => name === 'mch').map(([name, value]) => `{${name}:${spelled(value)}}`);
  for (const group of [...GROUPS, ...SYSTEMS, ...TOOLS]) {
    const members = Object.entries(file[group] ?? {}).filter(([name]) => group !== 'sys' || !special.includes(name));
    lines.push(...packed(group, members));
  }
  const late = (names) => packed('sys', system.filter(([name]) => names.includes(name)));
  return [...lines, ...late(STOPPING), ...late(TALK)];
}

/// Splits the members of a group into as few lines as possible.
function packed(group, members) {
  const wrap = (pairs) => (group === 'sys' ? `{${pairs}}` : `{${group}:{${pairs}}}`);
  const lines = [];
  let some = [];
  for (const [name, value] of members) {
    const pair = `${name}:${spelled(value)}`;
    if (some.length > 0 && wrap([...some, pair].join(',')).length > LINE) {
      lines.push(wrap(some.join(',')));
      some = [];
    }
    some.push(pair);
  }
  if (some.length > 0) lines.push(wrap(some.join(',')));
  return lines;
}

/// Returns the file as lines for a sender.
export function asLines(file) {
  return `${requests(file).join('\n')}\n`;
}

/// Parses a file of either kind. Returns its requests. The error says what is wrong with the file.
export function read(text) {
  if (/^\s*\{\s*"/.test(text)) {
    const file = JSON.parse(text);
    const known = [...GROUPS, ...SYSTEMS, ...TOOLS, ...STORED];
    if (!Object.keys(file).some((group) => known.includes(group))) throw new Error('no group of settings in this file');
    return requests(file);
  }
  const lines = text.split('\n').map((line) => line.trim()).filter((line) => line !== '');
  const wrong = lines.find((line) => !/^[{$]/.test(line));
  if (wrong !== undefined || lines.length === 0) throw new Error(`no setting: ${wrong ?? 'the file is empty'}`);
  return lines;
}

/// The status of a value that cannot be set. A file may contain such values.
const READ_ONLY = 104;

/// Sends requests. Returns the refused ones, each with its status. After a refused line each of its members is sent on
/// its own.
export async function load(board, lines) {
  const refused = [];
  for (const line of lines) {
    const { status } = await board.ask(line);
    if (status === 0) continue;
    for (const part of parts(line)) {
      const again = await board.ask(part);
      if (again.status !== 0 && again.status !== READ_ONLY) refused.push({ line: part, status: again.status });
    }
  }
  return refused;
}

/// Returns a request for each member of a line.
function parts(line) {
  const group = /^\{(\w+):\{(.*)\}\}$/.exec(line);
  const pairs = (group ? group[2] : line.slice(1, -1)).split(',');
  return pairs.map((pair) => (group ? `{${group[1]}:{${pair}}}` : `{${pair}}`));
}
