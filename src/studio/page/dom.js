// Small parts that pages are made of.

export const byId = (id) => document.getElementById(id);

export function element(name, className = '', text = '') {
  const made = document.createElement(name);
  made.className = className;
  made.textContent = text;
  return made;
}

export function icon(name) {
  const namespace = 'http://www.w3.org/2000/svg';
  const made = document.createElementNS(namespace, 'svg');
  const use = document.createElementNS(namespace, 'use');
  use.setAttribute('href', `#icon-${name}`);
  made.append(use);
  return made;
}

// The part of a slider's track that is filled.
export function showFill(input) {
  const part = (input.value - input.min) / (input.max - input.min);
  input.style.setProperty('--part', `${Math.min(1, Math.max(0, part)) * 100}%`);
}
