// The looks of the scene as JSON: what the server told, and how they are changed. Whatever of them is not known here stays as it is.

import { state, listen, tell } from './state.js';
import { isOpen } from './socket.js';
import { makeSender, whenSettled } from './sender.js';
import { byId } from './dom.js';

const PATIENCE_MS = 4000; // for the server's answer to a change

const section = byId('looks-section');
const sender = makeSender('looks');
let sent = null; // what the server has not answered yet
let sentAt = 0;

// A hand begins to drag: what it changes is one step to undo.
export const beginDrag = () => sender.begin();

// Changes a copy of the looks, and sends it. Changes of one drag go on with each other.
export function drag(change) {
  if (!isOpen() || !state.looks) return;
  const looks = structuredClone(state.looks.looks);
  change(looks);
  state.looks = { ...state.looks, looks, isTold: false };
  sender.hold();
  sent = JSON.stringify(looks);
  sentAt = performance.now();
  sender.push({ looks });
  tell('looks');
}

// The same, as a step of its own.
export function change(make) {
  beginDrag();
  drag(make);
  beginDrag();
}

const isWaiting = () => sent !== null && performance.now() - sentAt < PATIENCE_MS;
const isHeld = () => section.matches(':has(input[type=range]:active, canvas:active)');

const isBusy = () => sender.isBusy() || isWaiting() || isHeld();

const take = whenSettled(isBusy, (told) => {
  state.looks = { ...told, isTold: true };
  tell('looks');
});

// In the midst of a drag the looks are those of the hand, and all else is as it was told.
function hear(told) {
  if (sent === JSON.stringify(told.looks)) sent = null;
  if (state.looks && isBusy()) {
    state.looks = { ...told, looks: state.looks.looks, isTold: sent === null };
    tell('looks');
  }
  take(told);
}

// What the view gives a click to, in place of the brush: `hint` says what for, `begin`, `move` and `end` get the view and the place in its
// picture.
export function askView(asks) {
  state.asks = state.free ? null : asks;
  tell('asks');
}

export function stopAsking() {
  if (!state.asks) return false;
  askView(null);
  return true;
}

export function choosePoint(point) {
  state.point = point;
  tell('looks');
}

function show() {
  section.hidden = !state.looks;
  const { occluders = [], transfer } = state.looks?.looks ?? {};
  const count = occluders.length ?? 0;
  const edits = count > 0 ? `${count} edit${count === 1 ? '' : 's'}` : '';
  byId('looks-of').textContent = [edits, transfer ? 'colour' : ''].filter(Boolean).join(', ');
}

export function watchLooks() {
  listen('looks-told', hear);
  listen('looks', show);
  listen('scene', () => {
    if (state.scene.is_volume) state.looks = null;
    show();
  });
  listen('notice', ({ kind }) => {
    // It may be that the last change was refused: then the looks are as they were.
    if (kind === 'error') sent = null;
  });
  listen('socket', () => {
    sent = null;
    stopAsking();
  });
  listen('free tool', stopAsking);
  listen('live selection', () => {
    // Delete belongs to what was touched last.
    if (state.point && (state.live || state.selection)) choosePoint(null);
  });
  section.addEventListener('toggle', () => {
    stopAsking();
    state.showsPoints = section.open;
    tell('marks');
  });
}
