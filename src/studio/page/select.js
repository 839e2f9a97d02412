// The tool Select: finds the stroke below the pointer, and moves it.

import { state, tell } from './state.js';
import { toPicture } from './camera.js';
import { commit, select, selectedStroke } from './actions.js';
import { isShown } from './groups.js';
import { isOnStroke, movedBy, touchesPicture } from './strokes.js';
import { send } from './socket.js';

const NEAR = 5; // pixels of the screen: thin strokes can be hit, too
const STILL = 3; // pixels of the screen that a click may slip

let start = null;
let original = null;

function strokeAt({ view, scale }, point) {
  const strokes = state.strokes[view] ?? [];
  return strokes.findLastIndex((stroke) => isShown(stroke) && isOnStroke(point, stroke, NEAR / scale));
}

export function startMove(place, point) {
  commit();
  const number = strokeAt(place, toPicture(place, point));
  const selection = number < 0 ? null : { view: place.view, number };
  select(selection);
  original = selectedStroke();
  start = point;
  send({ type: 'pen', down: true });
}

export function move(place, point) {
  const shift = [point.x - start.x, point.y - start.y];
  if (!original || (!state.draft && Math.hypot(...shift) < STILL)) return;
  const points = movedBy(original.points, shift.map((part) => part / place.scale));
  const stroke = { ...original, points };
  // At the rim of the picture the stroke stops: outside of it, it would mean nothing.
  if (!touchesPicture(stroke, place.size)) return;
  state.draft = { ...state.selection, stroke };
  tell('marks');
}

export function endMove() {
  send({ type: 'pen', down: false });
  if (state.draft) state.strokeEndedAt = performance.now();
  commit();
  original = null;
}

export function cancelMove() {
  state.draft = null;
  original = null;
  send({ type: 'pen', down: false });
  tell('marks');
}
