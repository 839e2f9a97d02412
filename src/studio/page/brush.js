// Strokes: from where the pen touches to where it leaves.

import { state, tell, remember } from './state.js';
import { toPicture } from './camera.js';
import { addPoint, distance, rounded, touchesPicture } from './strokes.js';
import { send, sendPaint } from './socket.js';

const LEAST_PRESSURE = 0.05;
const FOLLOWS = 0.5; // how much of a change of the pressure the next point takes over

let straightFrom = -1; // the point that a straight line starts from
let force = { first: 0, now: 1 }; // of the pen: as it touched, and smoothed

export function startStroke(place, point, { isErasing }) {
  const { color, radius, hardness, opacity } = state.brush;
  const points = [toPicture(place, point)];
  const stroke = { points, radius: rounded(radius), hardness, opacity, weight: 1, color, erase: isErasing };
  if (state.group) stroke.group = state.group;
  force = { first: point.pressure, now: null };
  const isFelt = point.pressure !== undefined && state.penPressure;
  const pressures = isFelt ? [pressureNow(point)] : undefined;
  state.live = { view: place.view, stroke, pressures };
  straightFrom = -1;
  send({ type: 'pen', down: true });
  tell('live');
}

// Smoothed, so that the edge of the paint does not tremble.
function pressureNow({ pressure }) {
  const wanted = Math.min(1, Math.max(LEAST_PRESSURE, pressure));
  force.now = force.now === null ? wanted : force.now + FOLLOWS * (wanted - force.now);
  return rounded(force.now);
}

export function extendStroke(place, points, { isStraight }) {
  const { stroke, pressures } = state.live;
  if (isStraight && straightFrom < 0) straightFrom = stroke.points.length - 1;
  if (!isStraight) straightFrom = -1;
  for (const point of points) {
    const reached = toPicture(place, point);
    const pressure = pressures && pressureNow(point);
    // A pen that always says the same cannot feel how hard it is pressed.
    if (pressures && point.pressure !== force.first) stroke.pressure = pressures;
    if (isStraight) {
      stroke.points.splice(straightFrom + 1, Infinity, reached);
      pressures?.splice(straightFrom + 1, Infinity, pressure);
    } else {
      addPoint(stroke, reached, pressures, pressure);
    }
    // The paint follows the pen also between two points that are kept.
    state.live.tip = { point: reached, pressure };
  }
  tell('live');
}

// With the place where the pen is now as its end.
export function strokeUnderWay({ stroke, tip }) {
  if (!tip) return stroke;
  const pressure = stroke.pressure && [...stroke.pressure, tip.pressure];
  return { ...stroke, points: [...stroke.points, tip.point], pressure };
}

export function endStroke(place, point) {
  const { view, stroke, pressures } = state.live;
  // The stroke ends where the pen left, though the last step may have been a small one.
  const end = toPicture(place, point);
  if (straightFrom < 0 && distance(stroke.points.at(-1), end) > 0.5) {
    stroke.points.push(end);
    pressures?.push(pressures.at(-1));
  }
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
