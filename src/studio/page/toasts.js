// Notices in the corner: they leave by themselves, errors stay until they are dismissed.

import { listen } from './state.js';
import { byId, element, icon } from './dom.js';

const SECONDS = { done: 6, warning: 14 };
const MOST = 4;

const shelf = byId('toasts');

function showNotice({ kind, text }) {
  // The same notice again is not a second one.
  const same = [...shelf.children].find((toast) => toast.dataset.text === `${kind} ${text}`);
  same?.remove();
  const toast = element('div', `toast is-${kind}`);
  toast.dataset.text = `${kind} ${text}`;
  toast.setAttribute('role', kind === 'error' ? 'alert' : 'status');
  const close = element('button', 'icon small');
  close.setAttribute('aria-label', 'Dismiss');
  close.append(icon('close'));
  close.addEventListener('click', () => toast.remove());
  toast.append(element('p', 'toast-text', text), close);
  shelf.append(toast);
  const leaving = [...shelf.children].filter((each) => !each.matches('.is-error'));
  if (shelf.children.length > MOST) leaving[0]?.remove();
  if (kind in SECONDS) leaveLater(toast, SECONDS[kind] * 1000);
}

// While the pointer is on it, it stays.
function leaveLater(toast, wait) {
  const check = () => (toast.matches(':hover, :focus-within') ? setTimeout(check, 1000) : toast.remove());
  setTimeout(check, wait);
}

export function watchToasts() {
  listen('notice', showNotice);
}
