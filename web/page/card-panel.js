// The files of the machine's SD card: list, run, delete, and write the job of the page as a file.
//
// Part of the machine's panel, in TinyG's dialect only. A board without a card refuses the list, and the panel says so.

import { byId, grouped, h, say } from './dom.js';

/// Statuses of a machine without the names, or whose card cannot be read.
const UNKNOWN = 100;

/// Returns a name as the card has it: eight letters and three.
export function cardName(name) {
  const point = name.lastIndexOf('.');
  const clean = (text, length) => text.toUpperCase().replace(/[^A-Z0-9_-]/g, '').slice(0, length);
  const stem = clean(point < 0 ? name : name.slice(0, point), 8) || 'JOB';
  const ending = point < 0 ? 'NC' : clean(name.slice(point + 1), 3) || 'NC';
  return `${stem}.${ending}`;
}

/// Returns the files in the value of `sdl`: `{ name, size }`.
export function filesOf(list) {
  return list.split('\n').filter(Boolean).map((line) => {
    const at = line.lastIndexOf(' ');
    return { name: line.slice(0, at), size: Number(line.slice(at + 1)) };
  });
}

export class CardPanel {
  #board;
  /// The file that is being written.
  #writes;

  /// `context` has `codes` and `job()`, which returns the page's job.
  constructor(context) {
    this.context = context;
    this.list = h('ul', { class: 'findings', id: 'card-files' });
    this.text = h('p', { class: 'filename', id: 'card-text', role: 'status' });
    const button = (id, text, act) => h('button', { type: 'button', id, onclick: () => this.#try(act) }, text);
    this.view = h('div', { class: 'settings', id: 'card' },
      h('h2', {}, 'SD card'),
      h('div', { class: 'buttons' },
        button('card-list', 'List the files', () => this.#show()),
        button('card-write', 'Write the job to the card', () => this.#write()),
        button('card-end', 'End the file', () => this.#ask('{sdx:t}'))),
      this.text, this.list);
  }

  /// Connects the panel to this board.
  use(board) {
    this.#board = board;
    this.list.replaceChildren();
    this.text.textContent = '';
    board.on('streamed', (streamed) => this.#try(() => this.#written(streamed)));
  }

  async #try(act) {
    try {
      await act();
    } catch (error) {
      this.text.textContent = error.message;
    }
  }

  /// Sends a line, and returns the body of its answer. Throws if it is refused.
  async #ask(line) {
    const { body, status } = await this.#board.ask(line);
    if (status === UNKNOWN) throw new Error('This board has no SD card.');
    if (status !== 0) throw new Error(`${line}: ${status} ${this.context.codes.get(status)?.text ?? ''}`);
    return body;
  }

  async #show() {
    const files = filesOf((await this.#ask('{sdl:n}')).sdl);
    const act = (text, name, after, line) => h('button', { type: 'button', 'aria-label': `${text} ${name}`, onclick: () => this.#try(async () => {
      await this.#ask(line);
      await after();
    }) }, text);
    this.list.replaceChildren(...files.map(({ name, size }) => h('li', {}, `${name}, ${grouped(size)} bytes `,
      act('Run', name, () => (this.text.textContent = `${name} runs.`), `{sdr:"${name}"}`),
      act('Delete', name, () => this.#show(), `{sdd:"${name}"}`))));
    this.text.textContent = files.length === 1 ? '1 file' : `${files.length} files`;
  }

  async #write() {
    const job = this.context.job();
    if (!job) throw new Error('There is no job yet.');
    const name = cardName(job.name);
    await this.#ask(`{sdw:"${name}"}`);
    this.#writes = name;
    this.text.textContent = `${name} is being written.`;
    await this.#board.stream(job.text);
  }

  /// All lines have been answered. A file that lacks a line is given up.
  async #written({ refused, why }) {
    const name = this.#writes;
    this.#writes = undefined;
    if (!name) return;
    if (why || refused.length > 0) {
      await this.#ask('{sdx:t}');
      throw new Error(`${name} was not written: ${why || 'a line was refused'}.`);
    }
    await this.#ask('{sdw:t}');
    await this.#show();
    this.text.textContent = `${name} has been written.`;
    say(byId('card-text').textContent);
  }
}
