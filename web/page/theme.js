// Light and dark theme: that of the system, or the one selected by the switch. Fires `theme` on the document when it
// changes.

import { byId } from './dom.js';

const NAMES = { system: 'Colours: as the system has them', light: 'Colours: light', dark: 'Colours: dark' };
const SIGNS = { system: '◐', light: '☀', dark: '☾' };
const system = matchMedia('(prefers-color-scheme: dark)');

function stored() {
  try {
    return localStorage.getItem('kerf-theme') ?? 'system';
  } catch {
    return 'system';
  }
}

let choice = stored();

function apply() {
  const dark = choice === 'dark' || (choice === 'system' && system.matches);
  document.documentElement.dataset.theme = dark ? 'dark' : 'light';
  const button = byId('theme');
  button.textContent = SIGNS[choice];
  button.setAttribute('aria-label', NAMES[choice]);
  button.title = NAMES[choice];
  document.dispatchEvent(new Event('theme'));
}

export function startTheme() {
  byId('theme').addEventListener('click', () => {
    choice = { system: 'light', light: 'dark', dark: 'system' }[choice];
    try {
      localStorage.setItem('kerf-theme', choice);
    } catch {
      // The choice lasts for this visit.
    }
    apply();
  });
  system.addEventListener('change', apply);
  apply();
}

/// Returns the value of a colour of the theme.
export function colour(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
}
