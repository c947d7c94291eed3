// Helpers that make elements and format numbers. No state.

/// Makes an element: `h('button', { class: 'primary', onclick }, 'Run')`. Attributes that are false or missing are left
/// out.
export function h(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (value === false || value === undefined) continue;
    if (name.startsWith('on')) element.addEventListener(name.slice(2), value);
    else element.setAttribute(name, value === true ? '' : value);
  }
  element.append(...children.filter((child) => child !== undefined && child !== false));
  return element;
}

export const byId = (id) => document.getElementById(id);

/// Announces a text to screen readers.
export function say(text) {
  byId('say').textContent = text;
}

/// Formats a time: `1:02:03.4`, or `2:03.4`.
export function clock(ms) {
  const tenths = Math.round(ms / 100);
  const [h_, m, s] = [Math.floor(tenths / 36_000), Math.floor(tenths / 600) % 60, (tenths % 600) / 10];
  const seconds = s.toFixed(1).padStart(4, '0');
  return h_ > 0 ? `${h_}:${String(m).padStart(2, '0')}:${seconds}` : `${m}:${seconds}`;
}

/// Formats a number with thin spaces between groups: `12 345`.
export function grouped(number) {
  return (Math.round(number) || 0).toLocaleString('en').replaceAll(',', ' ');
}

export function millimetres(mm) {
  return mm >= 10_000 ? `${(mm / 1_000).toFixed(2)} m` : `${mm.toFixed(1)} mm`;
}

/// Makes the browser save a file.
export function download(name, text) {
  const url = URL.createObjectURL(new Blob([text], { type: 'text/plain' }));
  const link = h('a', { href: url, download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(url), 1_000);
}
