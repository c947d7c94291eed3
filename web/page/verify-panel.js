// The dialog in which a real board is checked: a warning, the progress, the verdict, and the report as a file.
//
// Owned by main.js. The dialog is modal, so nothing else in the page can be operated meanwhile. It cannot be closed
// while the checks run; Stop ends them.

import { Firmware } from './firmware.js';
import { byId, download, h, say } from './dom.js';
import { Link, check } from './verify.js';

const WARNING = 'Switch the motors’ supply off. The board is reset, settings are stored and restored, a short job runs.';
const HINT = 'It takes about half a minute. Keep this page in front: a browser slows the clock of a hidden page.';
const LIMITS = ['Only Kerf itself is checked, because a page flashes nothing. ', h('code', {}, 'cargo xtask verify'), ' checks the chip, too.'];
/// What the report says when the clock may have been slow.
const HIDDEN = 'The page was hidden for a time, so measured times may be wrong.';
/// Vendor of the boards with USB of their own. A reset takes their port away.
const OWN_USB = 0x1209;
const RESET = '\x18';

export class VerifyPanel {
  #board;
  #link;
  #file = '';
  #wasHidden = false;

  /// `context` has `module`, `board()`.
  constructor(context) {
    this.context = context;
    const button = (id, name, act, look) => h('button', { type: 'button', id: `check-${id}`, class: look, onclick: act }, name);
    this.buttons = {
      start: button('start', 'Check', () => this.#run(), 'primary'),
      stop: button('stop', 'Stop', () => this.#stop(), 'danger'),
      save: button('save', 'Save report', () => download('kerf-verify.md', this.#file), 'primary'),
      close: button('close', 'Close', () => this.dialog.close()),
    };
    this.warning = h('div', {}, h('p', {}, h('b', {}, WARNING)), h('p', { class: 'hint' }, HINT));
    this.log = h('div', { class: 'log', id: 'check-log', role: 'log', tabindex: 0, 'aria-label': 'What was checked' });
    this.verdict = h('p', { class: 'verdict', id: 'check-verdict' });
    const row = h('div', { class: 'buttons' }, ...Object.values(this.buttons));
    this.dialog = h('dialog', { id: 'checking', 'aria-labelledby': 'checking-title' },
      h('h2', { id: 'checking-title' }, 'Check this board'), this.warning, this.log, this.verdict, h('p', { class: 'hint', id: 'check-limits' }, ...LIMITS), row);
    this.dialog.addEventListener('cancel', (event) => this.#link && event.preventDefault());
    document.body.append(this.dialog);
    document.addEventListener('visibilitychange', () => (this.#wasHidden ||= document.hidden));
    byId('check').addEventListener('click', () => this.#open());
  }

  #open() {
    // The browser may have closed the dialog nevertheless.
    if (this.#link) return this.dialog.showModal();
    this.#board = this.context.board();
    if (this.#board.streaming) return say('A job is being sent. Check the board when it has ended.');
    const hasOwnUsb = this.#board.vendor === OWN_USB;
    this.log.replaceChildren();
    this.#show(hasOwnUsb ? ['close'] : ['start', 'close'], { verdict: hasOwnUsb ? 'A reset takes away the port of this board, because its USB is its own. Check it by cargo xtask verify.' : '', look: 'warn' });
    return this.dialog.showModal();
  }

  /// Shows these buttons, the warning or the log, and a verdict.
  #show(buttons, { verdict = '', look = '', warns = true } = {}) {
    for (const [name, button] of Object.entries(this.buttons)) button.hidden = !buttons.includes(name);
    this.dialog.setAttribute('closedby', buttons.includes('stop') ? 'none' : 'closerequest');
    this.warning.hidden = !warns || !buttons.includes('start');
    this.log.hidden = warns;
    this.verdict.hidden = verdict === '';
    this.verdict.className = `verdict ${look}`;
    this.verdict.textContent = verdict;
  }

  #tell(line) {
    this.log.append(h('div', { class: /^\s*FAILED/.test(line) ? 'error' : 'in' }, line));
    this.log.scrollTop = this.log.scrollHeight;
  }

  async #run() {
    this.#show(['stop'], { warns: false });
    this.#wasHidden = document.hidden;
    this.#link = new Link(this.#board);
    const { isSound, verdict, file } = await check(new Firmware(this.context.module), this.#link, {
      dialect: this.#board.greeted ?? this.#board.dialect, seed: Date.now(), tell: (line) => this.#tell(line) });
    await this.#link.end();
    this.#link = undefined;
    this.#file = this.#wasHidden ? `${file}\n${HIDDEN}\n` : file;
    if (this.#wasHidden) this.#tell(HIDDEN);
    this.#show(['save', 'close'], { verdict, look: isSound ? 'good' : 'bad', warns: false });
    say(verdict);
  }

  /// Ends motion at once, and then the checks.
  #stop() {
    this.#board.write(RESET);
    this.#link.fail('stopped by the person; the settings are perhaps not restored');
  }
}
