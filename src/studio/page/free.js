// The free camera: it orbits, slides, comes nearer and flies, and may be kept as a view. Nothing is painted meanwhile.

import { state, listen, tell } from './state.js';
import { chooseView, select } from './actions.js';
import { isOpen, send } from './socket.js';
import { byId } from './dom.js';

const TURN = 0.006; // radians for a pixel
const STEEPEST = 1.48; // radians from the horizon
const NEAREST = 0.01; // metres
const SPAN_A_SECOND = 0.12; // how fast it flies, in spans of the view
const LONGEST_FRAME = 0.1; // seconds: after a pause it does not leap
const PATIENCE_MS = 4000; // for a picture that may never come
const NAME = /^[\w -]{1,64}$/;

const bar = byId('free-bar');
const form = byId('keep-form');
const field = byId('keep-name');
const held = new Set(); // keys that fly
let asked = null; // the flight whose picture is under way
let askedAt = 0;
let isDue = false;
let lastFrame = 0;

const add = (one, other, factor = 1) => one.map((part, axis) => part + factor * other[axis]);
const minus = (one, other) => add(one, other, -1);
const dot = (one, other) => one.reduce((sum, part, axis) => sum + part * other[axis], 0);
const cross = ([a, b, c], [d, e, f]) => [b * f - c * e, c * d - a * f, a * e - b * d];
const unit = (vector) => vector.map((part) => part / Math.hypot(...vector));
const clamp = (value, low, high) => Math.min(high, Math.max(low, value));

const distanceOf = ({ origin, target }) => Math.hypot(...minus(target, origin));

// Forward, to the right and up, as the picture has them.
function axesOf({ origin, target, up }) {
  const forward = unit(minus(target, origin));
  const right = unit(cross(forward, up));
  return { forward, right, above: cross(right, forward) };
}

const cameraOf = (view) => {
  const { origin, target, up, fov } = state.views[view].camera;
  return { origin, target, up, fov };
};

export function enter() {
  if (!isOpen() || !state.views[state.view]?.camera) return;
  select(null);
  state.free = { view: state.view, camera: cameraOf(state.view), isSeen: false };
  state.pictures.delete('free/null');
  askName(false);
  tellAll();
  ask();
}

export function leave() {
  if (!state.free) return;
  state.free = null;
  held.clear();
  tellAll();
}

function tellAll() {
  tell('free');
  tell('seeing');
}

export const switchFree = () => (state.free ? leave() : enter());

function look(camera) {
  state.free.camera = { ...state.free.camera, ...camera };
  tell('free');
  ask();
}

export const home = () => look(cameraOf(state.free.view));

// One picture at a time: the next request has the newest camera.
function ask() {
  if (!state.free || !isOpen()) return;
  isDue = true;
  if (asked && performance.now() - askedAt < PATIENCE_MS) return;
  isDue = false;
  asked = state.free;
  askedAt = performance.now();
  send({ type: 'look_from', view: asked.view, camera: asked.camera });
}

function receive({ kind }) {
  if (kind !== 'free') return;
  // A picture of an earlier flight, or one that another page asked for, is not what is looked for here.
  if (asked && asked === state.free) state.free.isSeen = true;
  asked = null;
  if (isDue) ask();
}

// Around the target: about the world's y, and up and down.
export function orbit(across, down) {
  const { origin, target, up } = state.free.camera;
  const offset = minus(origin, target);
  const flat = Math.hypot(offset[0], offset[2]);
  const pitch = Math.atan2(offset[1], flat);
  // Straight above or below the target, the picture's top says where its front is.
  const [x, z] = flat > 1e-6 * Math.hypot(...offset) ? [offset[0], offset[2]] : [-up[0] * Math.sign(pitch), -up[2] * Math.sign(pitch)];
  const around = Math.atan2(x, z) - across * TURN;
  const risen = clamp(pitch + down * TURN, -STEEPEST, STEEPEST);
  const reach = Math.hypot(...offset);
  const moved = [Math.sin(around) * Math.cos(risen), Math.sin(risen), Math.cos(around) * Math.cos(risen)];
  look({ origin: add(target, moved, reach), up: upAfter(up, -across * TURN, risen) });
}

// A camera that lies on its side stays so, unless it looked down from above.
function upAfter([x, y, z], turn, pitch) {
  if (Math.abs(y) < 0.5 && Math.abs(pitch) < 1.4) return [0, 1, 0];
  return [x * Math.cos(turn) + z * Math.sin(turn), y, z * Math.cos(turn) - x * Math.sin(turn)];
}

function moveBy(shift) {
  const { origin, target } = state.free.camera;
  look({ origin: add(origin, shift), target: add(target, shift) });
}

// By pixels of a pane: what lies at the target's distance stays below the pointer.
export function slide({ size, scale }, across, down) {
  const { camera } = state.free;
  const { right, above } = axesOf(camera);
  const metres = (2 * distanceOf(camera) * Math.tan((camera.fov * Math.PI) / 360)) / (size[1] * scale);
  moveBy(add(right.map((part) => -part * across * metres), above, down * metres));
}

export function dolly(factor) {
  const { origin, target } = state.free.camera;
  const reach = Math.max(NEAREST, distanceOf(state.free.camera) * factor);
  look({ origin: add(target, unit(minus(origin, target)), reach) });
}

const WAYS = {
  w: ({ forward }) => forward,
  s: ({ forward }) => forward.map((part) => -part),
  d: ({ right }) => right,
  a: ({ right }) => right.map((part) => -part),
  e: () => [0, 1, 0],
  q: () => [0, -1, 0],
};
const ARROWS = { arrowup: 'w', arrowdown: 's', arrowright: 'd', arrowleft: 'a' };
const wayOf = (key) => WAYS[ARROWS[key] ?? key];

export function holdKey(key) {
  if (!wayOf(key)) return false;
  if (held.size === 0) {
    lastFrame = performance.now();
    requestAnimationFrame(fly);
  }
  held.add(key);
  return true;
}

export const letGoOf = (key) => held.delete(key);
export const letGoOfAll = () => held.clear();

function fly(now) {
  if (!state.free || held.size === 0) return;
  const seconds = clamp((now - lastFrame) / 1000, 0, LONGEST_FRAME);
  lastFrame = now;
  const axes = axesOf(state.free.camera);
  const way = [...held].reduce((sum, key) => add(sum, wayOf(key)(axes)), [0, 0, 0]);
  const span = state.look.span || distanceOf(state.free.camera);
  if (Math.hypot(...way) > 1e-6) moveBy(unit(way).map((part) => part * span * SPAN_A_SECOND * seconds));
  requestAnimationFrame(fly);
}

function askName(isAsked) {
  form.hidden = !isAsked;
  byId('keep').hidden = isAsked;
  byId('free-words').hidden = isAsked;
  if (!isAsked) {
    byId('view-canvas').focus({ preventScroll: true });
    return;
  }
  field.value = nextName();
  checkName();
  field.focus();
  field.select();
}

function nextName() {
  let number = state.views.length + 1;
  while (isTaken(`view ${number}`)) number += 1;
  return `view ${number}`;
}

// Views name files: spaces become dashes, and case makes no difference.
const fileOf = (name) => name.trim().replaceAll(' ', '-').toLowerCase();
const viewOf = (name) => state.views.findIndex((view) => fileOf(view.name) === fileOf(name));
const isTaken = (name) => viewOf(name) >= 0;

function checkName() {
  const name = field.value.trim();
  const isGood = NAME.test(name) && !isTaken(name);
  field.classList.toggle('is-wrong', !isGood);
  field.title = isGood ? '' : 'A name that no other view has, of the letters A to Z, digits, spaces, - and _';
  byId('keep-it').disabled = !isGood;
  return isGood && name;
}

function keep(event) {
  event.preventDefault();
  const name = checkName();
  if (!name || !state.free || !isOpen()) return;
  state.free.kept = name;
  send({ type: 'add_view', name, camera: shortened(state.free.camera) });
  byId('keep-it').disabled = true;
}

// People read scene files: numbers have as many digits as can matter.
function shortened({ origin, target, up, fov }) {
  const digits = clamp(5 - Math.floor(Math.log10(distanceOf({ origin, target }))), 0, 20);
  const short = (vector) => vector.map((part) => Number(part.toFixed(digits)));
  return { origin: short(origin), target: short(target), up: up.map((part) => Number(part.toFixed(6))), fov };
}

// A view that was kept is there, and is shown; one that is flown over may be gone.
function takeScene() {
  if (!state.free) return;
  const kept = state.free.kept ? viewOf(state.free.kept) : -1;
  if (kept >= 0) chooseView(kept);
  else if (state.views[state.view].camera) state.free.view = state.view;
  else leave();
  ask();
}

export function watchFree() {
  byId('keep').addEventListener('click', () => askName(true));
  byId('keep-cancel').addEventListener('click', () => askName(false));
  byId('leave').addEventListener('click', leave);
  form.addEventListener('submit', keep);
  field.addEventListener('input', checkName);
  field.addEventListener('keydown', (event) => {
    event.stopPropagation();
    if (event.key === 'Escape') askName(false);
  });
  listen('picture', receive);
  listen('free', () => {
    bar.hidden = !state.free;
  });
  listen('choice view', leave);
  listen('scene', takeScene);
  listen('notice', ({ kind }) => {
    if (kind !== 'error' || !state.free) return;
    // What was asked for may have been refused.
    asked = null;
    state.free.kept = undefined;
    checkName();
  });
  listen('socket', () => {
    asked = null;
    if (!isOpen()) leave();
  });
  listen('look strokes', ask);
  listen('exposed', ask);
  listen('progress', () => {
    if (state.progress.phase === 'done') ask();
  });
}
