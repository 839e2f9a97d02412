// Controls of a panel that are made as they are needed. Each has its nodes, and a way to show the value as it is now.

import { element, icon, showFill } from './dom.js';

const STEPS = 1000;

// What the steps of a slider stand for.
export const linear = (low, high) => ({
  toStep: (value) => (STEPS * (value - low)) / (high - low),
  toValue: (step) => low + ((high - low) * step) / STEPS,
});
export const logarithmic = (low, high) => ({
  toStep: (value) => (STEPS * Math.log(Math.max(value, low) / low)) / Math.log(high / low),
  toValue: (step) => low * (high / low) ** (step / STEPS),
});

export const percent = (value) => `${Math.round(value * 100)} %`;

let made = 0;

function labelled(label, control) {
  made += 1;
  control.id = `control-${made}`;
  const name = element('label', '', label);
  name.htmlFor = control.id;
  return name;
}

// `begin` hears that a hand begins to drag: what follows is one step to undo.
export function slider({ label, title = '', scale, digits = 3, read, write, begin, text }) {
  const input = Object.assign(element('input'), { type: 'range', min: 0, max: STEPS, step: 1, title });
  const name = labelled(label, input);
  const value = element('output');
  name.append(value);
  input.dataset.key = label;
  for (const hand of ['pointerdown', 'focus']) input.addEventListener(hand, begin);
  const valueNow = () => Number(scale.toValue(Number(input.value)).toPrecision(digits));
  input.addEventListener('input', () => write(valueNow()));
  const show = () => {
    const now = read();
    // A step that stands for the same rounded value stays, or keys would not get away from it.
    if (!input.matches(':active') && valueNow() !== now) input.value = Math.round(scale.toStep(now));
    value.textContent = text(now);
    input.setAttribute('aria-valuetext', text(now));
    showFill(input);
  };
  return { nodes: [name, input], show };
}

// Of some values, each with what it is called.
export function choice({ label, title = '', options, read, write }) {
  const select = Object.assign(element('select', 'field'), { title });
  for (const [value, text] of options) select.append(Object.assign(element('option', '', text), { value }));
  const row = element('div', 'choice');
  select.dataset.key = label;
  row.append(labelled(label, select), select);
  select.addEventListener('change', () => write(select.value));
  const show = () => {
    select.value = read();
  };
  return { nodes: [row], show };
}

export function toggle({ label, title = '', read, write }) {
  const input = Object.assign(element('input'), { type: 'checkbox', title });
  input.setAttribute('role', 'switch');
  input.dataset.key = label;
  const name = Object.assign(element('label', 'switch', label), { title });
  name.append(input);
  input.addEventListener('change', () => write(input.checked));
  const show = () => {
    input.checked = read();
  };
  return { nodes: [name], show };
}

export function push({ label, title = '', run, isPressed = null }) {
  const button = Object.assign(element('button', 'text push', label), { title });
  button.dataset.key = label;
  button.addEventListener('click', run);
  const show = () => isPressed && button.setAttribute('aria-pressed', isPressed());
  return { nodes: [button], show };
}

// A spot of colour that opens the picker; `ask` shows it.
export function spot({ label, read, ask }) {
  const button = element('button', 'spot');
  const row = element('div', 'choice');
  row.append(labelled(label, button), button);
  button.dataset.key = label;
  button.title = 'Choose another colour';
  button.addEventListener('click', () => ask(button));
  const show = () => {
    button.style.backgroundColor = read();
  };
  return { nodes: [row], show };
}

export const note = (text) => ({ nodes: [element('p', 'quiet', text)], show: () => {} });

// Several controls in one box.
export function box(className, parts) {
  const made = element('div', className);
  made.append(...parts.flatMap(({ nodes }) => nodes));
  return { nodes: [made], show: () => parts.forEach(({ show }) => show()) };
}

// A row of a list that opens: its name, a word on its value, buttons for its place in the list, and what is in it. It is number `number` of
// `count`, and one up is `upward` in these numbers. `sign` adds a mark before the name, and gives back what shows it.
export function row({ kind, number, count, upward, name, title, read, isOpen, open, move, remove, sign, parts }) {
  const keyOf = (at) => `${kind} ${at}`;
  const made = element('div', `row${isOpen ? ' is-open' : ''}`);
  const head = element('div', 'row-head');
  const opens = element('button', 'row-name');
  const detail = element('span', 'row-detail');
  opens.append(element('span', '', name), detail);
  opens.dataset.key = `${keyOf(number)} open`;
  opens.title = title;
  opens.setAttribute('aria-expanded', isOpen);
  opens.addEventListener('click', open);
  const showSign = sign?.(opens);
  const buttons = element('div', 'row-buttons');
  head.append(opens, buttons);
  buttons.append(...[
    ['up', 'Move up', upward],
    ['down', 'Move down', -upward],
    ['close', 'Remove', 0],
  ].map(([mark, says, step]) => {
    const other = number + step;
    const button = Object.assign(element('button', 'icon small'), { title: says, disabled: other < 0 || other >= count });
    button.setAttribute('aria-label', `${says}: ${name}`);
    button.dataset.key = `${keyOf(number)} ${mark}`;
    button.append(icon(mark));
    button.addEventListener('click', () => {
      // The focus goes along.
      button.dataset.key = `${keyOf(other)} ${mark}`;
      if (step === 0) remove();
      else move(step);
    });
    return button;
  }));
  made.append(head);
  const inside = isOpen ? box('row-inside sliders', parts()) : null;
  if (inside) made.append(...inside.nodes);
  const show = () => {
    detail.textContent = read();
    showSign?.();
    inside?.show();
  };
  return { nodes: [made], show };
}

// Keeps what is in `host`: it is built anew where its structure is another one, and else shows its values only. The control that has the
// focus keeps it.
export function keeper(host) {
  let built = null;
  let parts = [];
  return (structure, build) => {
    const sign = JSON.stringify(structure);
    if (sign !== built) {
      const key = host.contains(document.activeElement) ? document.activeElement.dataset.key : undefined;
      built = sign;
      parts = build();
      host.replaceChildren(...parts.flatMap(({ nodes }) => nodes));
      const next = key === undefined ? null : host.querySelector(`[data-key="${CSS.escape(key)}"]`);
      (next?.disabled ? next.closest('.row').querySelector('.row-name') : next)?.focus({ preventScroll: true });
    }
    parts.forEach(({ show }) => show());
  };
}
