// The settings as a form, made from `settings.schema.json`, and as a file. The schema is generated from the firmware's
// table.
//
// Owned by main.js. Fields show the values of the machine. A change is sent at once, and the field then shows the value
// that the machine has stored. A refusal is shown at the field. A group is read when the user selects it.

import { choices } from './settings-choices.js';
import { asLines, load, read, save } from './settings-file.js';
import { download, h, say } from './dom.js';

const NAMES = {
  sys: 'The machine', 1: 'Motor 1', 2: 'Motor 2', 3: 'Motor 3', 4: 'Motor 4', x: 'Axis X', y: 'Axis Y', z: 'Axis Z', a: 'Axis A', b: 'Axis B', c: 'Axis C',
  p1: 'Pulses of the spindle', sp: 'Spindle', co: 'Coolant', sq: 'Squaring',
};

/// Returns the range of a number as text. Limits that no machine comes near are left out.
function rangeOf(about) {
  const { minimum, maximum } = about;
  if (minimum === undefined || choices(about)) return '';
  const [low, high] = [Math.abs(minimum) < 1e5, Math.abs(maximum) < 1e5];
  if (low && high) return `${minimum} to ${maximum}`;
  return low ? `${minimum} and more` : '';
}

/// Converts a description: text between backticks becomes code.
function spelled(text) {
  return text.split('`').map((part, n) => (n % 2 === 1 ? h('code', {}, part) : part));
}

export class SettingsPanel {
  #board;
  #schema;

  constructor(pane, schema, codes) {
    this.#schema = schema.properties;
    this.codes = codes;
    const groups = Object.keys(NAMES).filter((group) => this.#schema[group]);
    this.group = h('select', { id: 'group' }, ...['x', ...groups.filter((g) => g !== 'x')].map((group) => h('option', { value: group }, NAMES[group])));
    this.group.addEventListener('change', () => this.show());
    this.search = h('input', { type: 'search', id: 'search', placeholder: 'jerk, switch, units…' });
    this.search.addEventListener('input', () => this.#filter());
    this.file = h('input', { type: 'file', id: 'settings-file', accept: '.json,.txt', class: 'visually-hidden', tabindex: -1, 'aria-label': 'Settings file' });
    this.file.addEventListener('change', () => this.#import(this.file.files[0]));
    this.told = h('p', { class: 'hint', role: 'status', id: 'settings-told' });
    this.list = h('div', { id: 'settings-list' });
    pane.append(
      h('div', { class: 'row' }, h('div', { class: 'field' }, h('label', { for: 'group' }, 'Group'), this.group), h('div', { class: 'field' }, h('label', { for: 'search' }, 'Find in the group'), this.search)),
      h('div', { class: 'buttons' },
        h('button', { type: 'button', id: 'export', onclick: () => this.#export('json') }, 'Export'),
        h('button', { type: 'button', id: 'export-lines', onclick: () => this.#export('lines') }, 'Export as lines'),
        h('button', { type: 'button', id: 'import', onclick: () => this.file.click() }, 'Import…'), this.file),
      this.told, this.list);
  }

  use(board) {
    this.#board = board;
    this.told.textContent = '';
  }

  /// Reads the group from the machine and shows it.
  async show() {
    const group = this.group.value;
    try {
      if (this.#board.dialect === 'grbl') throw new Error('they are asked for in TinyG\u2019s dialect');
      const { body, status } = await this.#board.ask(`{${group}:n}`);
      if (status !== 0) throw new Error(`the machine refuses with status ${status}`);
      const rows = Object.entries(this.#schema[group].properties).filter(([name]) => name in (body[group] ?? {}));
      this.list.replaceChildren(...rows.map(([name, about]) => this.#row(group, name, about, body[group][name])));
      this.#filter();
    } catch (error) {
      this.told.textContent = `The settings cannot be read: ${error.message}.`;
    }
  }

  #filter() {
    const wanted = this.search.value.trim().toLowerCase();
    for (const row of this.list.children) row.hidden = !row.textContent.toLowerCase().includes(wanted);
  }

  #row(group, name, about, value) {
    const full = group === 'sys' ? name : `${group}${name}`;
    const id = `set-${full}`;
    const field = this.#field(id, about, value);
    const refusal = h('p', { class: 'refusal', hidden: true, id: `${id}-refusal` });
    const row = h('div', { class: 'setting' });
    const mark = () => row.classList.toggle('changed', about.default !== undefined && String(field.value) !== String(about.default));
    field.addEventListener('change', async () => {
      const text = about.type === 'string' ? `"${field.value}"` : field.value;
      try {
        const { body, status } = await this.#board.ask(`{${full}:${text}}`);
        const is = body[full];
        if (status === 0 && is !== undefined && is !== null) field.value = is;
        refusal.hidden = status === 0;
        refusal.textContent = status === 0 ? '' : `Refused: ${status} ${this.codes.get(status)?.text ?? ''}`;
        field.setAttribute('aria-invalid', String(status !== 0));
        mark();
      } catch (error) {
        refusal.hidden = false;
        refusal.textContent = error.message;
      }
    });
    const unit = [about.unit, rangeOf(about)].filter(Boolean).join(', ');
    row.append(
      h('label', { for: id }, full, ' ', h('small', {}, unit)), field,
      h('p', { id: `${id}-about` }, ...spelled(about.description ?? ''), about.default === undefined ? '' : ` Default ${about.default}.`), refusal);
    mark();
    return row;
  }

  #field(id, about, value) {
    const common = { id, 'aria-describedby': `${id}-about`, disabled: about.readOnly === true };
    const names = choices(about);
    if (names) {
      const option = (name, n) => h('option', { value: n + about.minimum, selected: n + about.minimum === value }, `${n + about.minimum} ${name}`);
      return h('select', common, ...names.map(option));
    }
    if (about.type === 'string') return h('input', { ...common, type: 'text', value });
    return h('input', { ...common, type: 'number', step: about.type === 'integer' ? 1 : 'any', value });
  }

  async #export(kind) {
    this.told.textContent = 'Reading all settings…';
    try {
      const file = await save(this.#board);
      if (kind === 'json') download('kerf-settings.json', `${JSON.stringify(file, null, 2)}\n`);
      else download('kerf-settings.txt', asLines(file));
      this.told.textContent = kind === 'json' ? 'Exported. `cargo xtask settings load` reads this file, too.' : 'Exported. A sender sends this file like a job; `cargo xtask sim --set @FILE` reads it.';
    } catch (error) {
      this.told.textContent = `Not exported: ${error.message}.`;
    }
  }

  async #import(file) {
    if (!file) return;
    try {
      const lines = read(await file.text());
      this.told.textContent = `Sending ${lines.length} lines…`;
      const refused = await load(this.#board, lines);
      const shown = refused.slice(0, 5).map(({ line, status }) => `${line} with ${status}`);
      this.told.textContent = refused.length === 0 ? `${file.name} is on the machine.` : `${file.name}: ${refused.length} values were refused: ${shown.join('; ')}.`;
      await this.show();
    } catch (error) {
      this.told.textContent = `Not imported: ${error.message}.`;
    }
    this.file.value = '';
    say(this.told.textContent);
  }
}
