// What buttons, sliders and keys do: each change of the state by the artist goes through here.

import { state, listen, tell, remember } from './state.js';
import { fit } from './camera.js';
import { isOpen, send, sendExposure } from './socket.js';

const COMMIT_MS = 400;
const EXPOSURE_MS = 80;

let commitTimer = 0;
let exposureTimer = 0;
let rememberTimer = 0;
let toolBefore = 'brush';

const clamp = (value, low, high) => Math.min(high, Math.max(low, value));

export function selectedStroke() {
  if (!state.selection) return null;
  const { view, number } = state.selection;
  return state.draft?.stroke ?? state.strokes[view]?.[number] ?? null;
}

// What colour and sliders show and change: the selected stroke, or else the brush.
export const paintInHand = () => selectedStroke() ?? state.brush;

export function largestRadius() {
  const sides = state.views.flatMap(({ size }) => size);
  return Math.max(16, Math.max(0, ...sides) / 4);
}

export function adjust(change) {
  const stroke = selectedStroke();
  if (stroke) {
    state.draft = { ...state.selection, stroke: { ...stroke, ...change } };
    clearTimeout(commitTimer);
    commitTimer = setTimeout(commit, COMMIT_MS);
    tell('marks');
  } else {
    Object.assign(state.brush, change);
    clearTimeout(rememberTimer);
    rememberTimer = setTimeout(remember, 300);
  }
  tell('brush', change);
}

export function chooseColor(color) {
  if (state.tool === 'eraser') chooseTool('brush');
  adjust({ color });
}

export function scaleRadius(factor) {
  const radius = paintInHand().radius * factor;
  adjust({ radius: Math.round(clamp(radius, 0.5, largestRadius()) * 100) / 100 });
}

// Many small changes of a selected stroke are one step to the server, and one to undo.
export function commit() {
  clearTimeout(commitTimer);
  if (!state.draft) return;
  const { view, number, stroke } = state.draft;
  state.draft = null;
  state.strokes[view][number] = stroke;
  send({ type: 'replace', view, number, stroke });
  tell('marks');
}

export function select(selection) {
  commit();
  state.selection = selection;
  tell('selection');
}

export function chooseTool(tool) {
  if (tool !== 'select') select(null);
  if (tool === 'pick' && state.tool !== 'pick') toolBefore = state.tool;
  state.tool = tool;
  tell('tool');
}

export function returnFromPick() {
  if (state.tool !== 'pick') return;
  state.tool = toolBefore;
  tell('tool');
}

export function chooseView(view) {
  if (!state.views[view]) return;
  state.showsAll = false;
  tell('choice');
  makeActive(view);
  tell('seeing');
}

export function makeActive(view) {
  if (view === state.view) return;
  if (state.selection && state.selection.view !== view) select(null);
  state.view = view;
  tell('view');
}

export function see(kind) {
  state.seen = kind;
  tell('seeing');
}

export function peek(isOn) {
  if (state.peeks === isOn) return;
  state.peeks = isOn;
  tell('seeing');
}

// What only light shafts have.
const OF_SHAFTS = ['showsReach', 'showsConflicts', 'showsLightMap'];

export const isOffered = (name) => !state.scene?.is_volume || !OF_SHAFTS.includes(name);

export function toggle(name) {
  if (!isOffered(name)) return;
  state[name] = !state[name];
  tell('seeing');
}

export function moveWipe(part) {
  state.wipe = clamp(part, 0, 1);
  tell('wipe');
}

// Every picture comes again at each exposure: a slider that is dragged asks for a few of them only.
export function setStops(stops) {
  state.stops = stops;
  tell('exposure');
  if (exposureTimer) return;
  exposureTimer = setTimeout(() => {
    exposureTimer = 0;
    sendExposure();
    tell('exposed');
  }, EXPOSURE_MS);
}

export const theme = () => state.theme || (matchMedia('(prefers-color-scheme: light)').matches ? 'light' : 'dark');

function switchTheme() {
  state.theme = theme() === 'dark' ? 'light' : 'dark';
  remember();
  tell('theme');
}

function remove() {
  if (!isOpen()) return;
  if (!state.selection) {
    if (state.point) tell('removal');
    return;
  }
  const { view, number } = state.selection;
  state.draft = null;
  select(null);
  send({ type: 'delete', view, number });
}

function clear() {
  if (!isOpen() || !state.strokes[state.view]?.length) return;
  select(null);
  send({ type: 'clear', view: state.view });
  tell('notice', { kind: 'done', text: `All strokes of ${state.views[state.view].name} are gone. Undo brings them back.` });
}

function step(type, isPossible) {
  commit();
  if (isPossible) send({ type });
}

export const commands = {
  undo: () => step('undo', state.canUndo),
  redo: () => step('redo', state.canRedo),
  save: () => step('save', true),
  export: () => step('export', !state.isExporting),
  cancel: () => send({ type: 'cancel' }),
  fitLightMap: () => send({ type: 'fit' }),
  remove,
  clear,
  fit,
  theme: switchTheme,
  help: () => tell('help'),
};

listen('strokes', () => {
  if (state.selection && !selectedStroke()) state.selection = null;
  tell('selection');
});
listen('socket', () => {
  if (isOpen()) return;
  // A change that cannot be sent must not look as if it were made.
  state.draft = null;
  select(null);
});
