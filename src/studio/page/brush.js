// Strokes: from where the pen touches to where it leaves.

import { state, tell, remember } from './state.js';
import { toPicture } from './camera.js';
import { addPoint, distance, rounded, touchesPicture } from './strokes.js';
import { send, sendPaint } from './socket.js';

let straightFrom = -1; // the point that a straight line starts from

export function startStroke(place, point, { isErasing }) {
  const { color, radius, hardness, opacity } = state.brush;
  const points = [toPicture(place, point)];
  const stroke = { points, radius: rounded(radius), hardness, opacity, weight: 1, color, erase: isErasing };
  state.live = { view: place.view, stroke };
  straightFrom = -1;
  send({ type: 'pen', down: true });
  tell('live');
}

export function extendStroke(place, points, { isStraight }) {
  const { stroke } = state.live;
  const reached = points.map((point) => toPicture(place, point));
  if (isStraight) {
    if (straightFrom < 0) straightFrom = stroke.points.length - 1;
    stroke.points.splice(straightFrom + 1, Infinity, reached.at(-1));
  } else {
    straightFrom = -1;
    for (const point of reached) addPoint(stroke.points, point, stroke.radius);
  }
  // The paint follows the pen also between two points that are kept.
  state.live.tip = reached.at(-1);
  tell('live');
}

export function endStroke(place, point) {
  const { view, stroke } = state.live;
  // The stroke ends where the pen left, though the last step may have been a small one.
  const end = toPicture(place, point);
  if (straightFrom < 0 && distance(stroke.points.at(-1), end) > 0.5) stroke.points.push(end);
  stroke.points = stroke.points.map((each) => each.map(rounded));
  cancelStroke();
  state.strokeEndedAt = performance.now();
  if (!touchesPicture(stroke, state.views[view].size)) return;
  state.pending.push({ view, stroke, revision: state.revision });
  sendPaint(view, stroke);
  noteColor(stroke);
  tell('marks');
}

// The server may work at full strength again, whether or not there is a stroke.
export function cancelStroke() {
  state.live = null;
  send({ type: 'pen', down: false });
  tell('live');
}

// Colours that the palette does not have stay at hand, the newest first.
function noteColor({ color, erase }) {
  if (erase || state.ownColors[0] === color || state.scene.palette.includes(color)) return;
  state.ownColors = [color, ...state.ownColors.filter((own) => own !== color)].slice(0, 8);
  remember();
  tell('colors');
}
