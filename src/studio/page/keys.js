// Shortcuts: one table for what keys do and for the sheet that lists them.

import { state, listen, tell } from './state.js';
import {
  adjust, chooseTool, chooseView, commands, moveWipe, paintInHand, peek, scaleRadius, see, select, toggle,
} from './actions.js';
import { zoomBy } from './camera.js';
import * as free from './free.js';
import { choosePoint, stopAsking } from './looks.js';
import { cancelGesture, closeSheet } from './pointer.js';
import { hardnessOf } from './strokes.js';

const canvas = document.getElementById('view-canvas');
const sheet = document.getElementById('help-sheet');

const harder = (step) => {
  const hardness = Math.min(1, Math.max(0, hardnessOf(paintInHand()) + step));
  adjust({ hardness: Math.round(hardness * 100) / 100 });
};
const opacityFrom = (digit) => adjust({ opacity: digit === 0 ? 1 : digit / 10 });
const digits = [1, 2, 3, 4, 5, 6, 7, 8, 9];
const seeOrAfter = (kind) => see(state.seen === kind ? 'after' : kind);

// Each line: what the sheet shows, what it says, and which strokes of keys run what. Lines without keys are for the pointer.
const groups = [
  ['Tools', [
    ['B', 'Brush', { b: () => chooseTool('brush') }],
    ['E', 'Eraser', { e: () => chooseTool('eraser') }],
    ['I', 'Pick a colour from the light', { i: () => chooseTool('pick') }],
    ['hold Alt', 'Pick a colour while painting'],
    ['V', 'Select and move strokes', { v: () => chooseTool('select') }],
    ['Delete', 'Delete the selected stroke or point', { delete: commands.remove, backspace: commands.remove }],
    ['Esc', 'Cancel, deselect', { escape: leave }],
  ]],
  ['Brush', [
    ['[  ]  or wheel', 'Size', { '[': () => scaleRadius(1 / 1.12), ']': () => scaleRadius(1.12) }],
    ['Shift [  ]', 'Hardness', { 'shift+[': () => harder(-0.1), 'shift+]': () => harder(0.1) }],
    ['Shift 1 … 0', 'Opacity', Object.fromEntries([0, ...digits].map((digit) => [`shift+${digit}`, () => opacityFrom(digit)]))],
    ['Shift drag', 'Straight line'],
  ]],
  ['Strokes and file', [
    ['Ctrl Z', 'Undo', { 'ctrl+z': commands.undo }],
    ['Ctrl Shift Z', 'Redo', { 'ctrl+shift+z': commands.redo, 'ctrl+y': commands.redo }],
    ['Ctrl S', 'Save', { 'ctrl+s': commands.save }],
    ['Double click', 'Rename a group'],
  ]],
  ['Looks', [
    ['click', 'On the table: add or choose a point'],
    ['drag', 'Move a point'],
    ['←  →  ↑  ↓', 'Move the chosen point of a table'],
    ['Delete', 'Remove the chosen point'],
    ['Esc', 'Leave placing and choosing in the picture'],
  ]],
  ['Seeing', [
    ['A', 'After', { a: () => see('after') }],
    ['hold Q', 'Before', { q: () => peek(true) }],
    ['T', 'Target', { t: () => seeOrAfter('target') }],
    ['D', 'Difference', { d: () => seeOrAfter('difference') }],
    ['W', 'Wipe between before and after', { w: () => seeOrAfter('wipe') }],
    ['←  →', 'Move the wipe', { arrowleft: () => stepWipe(-0.02), arrowright: () => stepWipe(0.02) }],
    ['R', 'Hatch what no light reaches', { r: () => toggle('showsReach') }],
    ['X', 'Hatch where paint contradicts paint', { x: () => toggle('showsConflicts') }],
    ['O', 'Outlines of strokes', { o: () => toggle('showsOutlines') }],
    ['L', 'Light map', { l: () => toggle('showsLightMap') }],
  ]],
  ['Views', [
    ['1 … 9', 'One view, large', Object.fromEntries(digits.map((digit) => [`${digit}`, () => chooseView(digit - 1)]))],
    ['Tab', 'All views', { tab: () => toggle('showsAll') }],
    ['+  −  or Ctrl wheel', 'Zoom', { '+': () => zoomBy(1.25), '=': () => zoomBy(1.25), '-': () => zoomBy(0.8) }],
    ['0', 'Fit', { 0: commands.fit }],
    ['Space drag', 'Move the picture'],
    ['Middle button', 'Move the picture'],
    ['F6', 'Between picture and tools', { f6: switchFocus }],
    ['?', 'This sheet', { '?': commands.help }],
  ]],
];

const freeLines = [
  ['C', 'Enter and leave', { c: free.switchFree }],
  ['drag', 'Around the middle'],
  ['Shift drag', 'Sideways, up and down'],
  ['wheel', 'Nearer and farther'],
  ['W  A  S  D', 'Fly; arrows do, too'],
  ['Q  E', 'Down, up'],
  ['0  or Home', "The view's own camera", { 0: free.home, home: free.home }],
  ['Esc', 'Leave', { escape: () => cancelGesture() || free.leave() }],
];

const runsOf = (lines) => lines.flatMap(([, , keys]) => Object.entries(keys ?? {}));
const runs = new Map([...groups.flatMap(([, lines]) => runsOf(lines)), ['c', free.switchFree]]);
const freeRuns = new Map(runsOf(freeLines));
// What else holds while the camera is free: the file, other views, this sheet.
const staysFree = (name) => /^(ctrl\+.+|[1-9]|f6|\?|l)$/.test(name);
const runFor = (name) => (state.free ? freeRuns.get(name) ?? (staysFree(name) && runs.get(name)) : runs.get(name));

function leave() {
  if (closeSheet() || cancelGesture() || stopAsking()) return;
  choosePoint(null);
  select(null);
}

function stepWipe(step) {
  if (state.seen === 'wipe' && isPictureFocused()) moveWipe(state.wipe + step);
}

function switchFocus() {
  const target = document.activeElement === canvas ? document.querySelector('.rail [aria-pressed=true]') : canvas;
  target?.focus();
}

const isPictureFocused = () => document.activeElement === canvas || document.activeElement === document.body;
const isTyping = () => document.activeElement?.matches('input[type=text], select');

// Digits and brackets by their place, as Shift turns them into other signs; letters by what they say on this keyboard.
function nameOf(event) {
  const digit = event.code.match(/^(?:Digit|Numpad)(\d)$/)?.[1];
  const bracket = { BracketLeft: '[', BracketRight: ']' }[event.code];
  const isSign = event.key.length === 1 && !/\p{L}/u.test(event.key);
  const isPlaced = digit !== undefined || (bracket && (isSign || event.shiftKey));
  const isAltGraph = event.getModifierState('AltGraph');
  const base = isPlaced ? digit ?? bracket : event.key.toLowerCase();
  const ctrl = (event.ctrlKey || event.metaKey) && !isAltGraph ? 'ctrl+' : '';
  return `${ctrl}${event.shiftKey && (isPlaced || !isSign) ? 'shift+' : ''}${base}`;
}

function pressed(event) {
  if (sheet.open) return;
  if (event.key === 'Alt') holdAlt(event, true);
  if (isTyping()) {
    if (event.key === 'Escape' || event.key === 'Enter') canvas.focus();
    return;
  }
  if (event.code === 'Space' && (isPictureFocused() || state.pointer)) {
    event.preventDefault();
    state.spaceHeld = true;
    tell('pointer');
    return;
  }
  if (event.altKey && !event.getModifierState('AltGraph')) return;
  const name = nameOf(event);
  // Tab belongs to the picture only there; elsewhere it goes from control to control. Arrows belong to sliders.
  const isKept = (name === 'tab' || name.startsWith('arrow')) && !isPictureFocused();
  if (state.free && !isKept && free.holdKey(name.replace('shift+', ''))) {
    event.preventDefault();
    return;
  }
  const run = isKept ? null : runFor(name);
  if (event.key === 'F6' || (event.key === 'Tab' && !run)) document.body.classList.add('by-keys');
  if (!run || (event.repeat && name === 'tab')) return;
  event.preventDefault();
  run();
}

function released(event) {
  if (event.key === 'Alt') holdAlt(event, false);
  if (event.key.toLowerCase() === 'q') peek(false);
  free.letGoOf(event.key.toLowerCase());
  if (event.code !== 'Space' || !state.spaceHeld) return;
  event.preventDefault();
  letGo();
}

function holdAlt(event, isHeld) {
  // Alone it would open the browser's menu.
  event.preventDefault();
  state.altHeld = isHeld;
  tell('pointer');
}

// Keys that go up while another window has the focus are never heard of.
function letGo() {
  state.spaceHeld = false;
  state.altHeld = false;
  peek(false);
  free.letGoOfAll();
  tell('pointer');
}

function fillSheet() {
  const make = (name, text = '') => Object.assign(document.createElement(name), { textContent: text });
  const parts = [...groups, ['Free camera', freeLines]].map(([title, lines]) => {
    const part = make('section');
    const list = make('dl');
    for (const [keys, says] of lines) {
      const term = make('dt');
      for (const word of keys.split(/ +/)) {
        const isPlain = ['or', '…', 'hold', 'drag', 'wheel', 'Middle', 'button', 'Double', 'click'].includes(word);
        term.append(make(isPlain ? 'span' : 'kbd', word), ' ');
      }
      list.append(term, make('dd', says));
    }
    part.append(make('h3', title), list);
    return part;
  });
  document.getElementById('shortcuts').replaceChildren(...parts);
}

export function watchKeys() {
  fillSheet();
  window.addEventListener('keydown', pressed);
  window.addEventListener('keyup', released);
  window.addEventListener('blur', letGo);
  window.addEventListener('pointerdown', () => document.body.classList.remove('by-keys'));
  sheet.addEventListener('click', ({ target }) => {
    if (target === sheet) sheet.close();
  });
  listen('help', () => sheet.showModal());
}
