// Geometry of strokes, and how they are drawn on a canvas.

import { cssColor } from './colour.js';

const MAX_POINTS = 10000;

// What the scene file leaves out stands for these values.
export const hardnessOf = (stroke) => stroke.hardness ?? 0.8;
export const opacityOf = (stroke) => stroke.opacity ?? 1;
const radiusAt = ({ radius, pressure }, index) => radius * (pressure?.[index] ?? 1);

export const rounded = (value) => Math.round(value * 100) / 100;

// Adds a point, and how hard the pen is pressed there, unless it is too near to the last one to matter.
export function addPoint({ points, radius }, point, pressures, pressure = 1) {
  const last = points.at(-1);
  if (distance(last, point) < Math.max(0.75, (radius * pressure) / 8)) {
    // A pen that presses harder where it is makes a larger dab.
    if (pressures) pressures.push(Math.max(pressures.pop(), pressure));
    return;
  }
  points.push(point);
  pressures?.push(pressure);
  if (points.length <= MAX_POINTS) return;
  thinOut(points);
  if (pressures) thinOut(pressures);
}

// A very long stroke loses every second point, never its first.
function thinOut(list) {
  const kept = list.filter((_, index) => index % 2 === 0);
  list.splice(0, list.length, ...kept);
}

export function distance([x, y], [u, v]) {
  return Math.hypot(u - x, v - y);
}

// How far along the line from start to end the point is, from 0 to 1.
function partAlong(point, start, end) {
  const along = [end[0] - start[0], end[1] - start[1]];
  const square = along[0] ** 2 + along[1] ** 2;
  const product = (point[0] - start[0]) * along[0] + (point[1] - start[1]) * along[1];
  return square > 0 ? Math.min(1, Math.max(0, product / square)) : 0;
}

const between = (one, other, part) => one + part * (other - one);

// Whether the point lies on the stroke; thin ones are as wide as `least`.
export function isOnStroke(point, stroke, least) {
  return stroke.points.some((end, index) => {
    const before = Math.max(0, index - 1);
    const start = stroke.points[before];
    const part = partAlong(point, start, end);
    const nearest = [between(start[0], end[0], part), between(start[1], end[1], part)];
    return distance(point, nearest) <= Math.max(least, between(radiusAt(stroke, before), radiusAt(stroke, index), part));
  });
}

// The server refuses strokes that lie wholly outside of the picture.
export function touchesPicture(stroke, size) {
  return stroke.points.some((point, index) => {
    const before = Math.max(0, index - 1);
    return crosses(stroke.points[before], point, Math.min(radiusAt(stroke, before), radiusAt(stroke, index)), size);
  });
}

// Whether the part from start to end enters the picture with a rim of the radius.
function crosses(start, end, radius, size) {
  let from = 0;
  let to = 1;
  for (const axis of [0, 1]) {
    const along = end[axis] - start[axis];
    const low = -radius - start[axis];
    const high = size[axis] + radius - start[axis];
    if (along === 0) {
      if (low >= 0 || high <= 0) return false;
    } else {
      from = Math.max(from, Math.min(low / along, high / along));
      to = Math.min(to, Math.max(low / along, high / along));
    }
  }
  return from < to;
}

export const movedBy = (points, [x, y]) => points.map((point) => [rounded(point[0] + x), rounded(point[1] + y)]);

function pathOf(stroke, pane) {
  const path = new Path2D();
  const place = ([x, y]) => [pane.x + x * pane.scale, pane.y + y * pane.scale];
  const [first, ...others] = stroke.points.map(place);
  path.moveTo(...first);
  // A canvas draws no cap where a line has no length.
  if (others.length === 0) path.lineTo(first[0] + 0.01, first[1]);
  for (const point of others) path.lineTo(...point);
  return path;
}

// What a pen covered that was pressed now more, now less: discs, and what lies between each and the next.
function taperedPath(stroke, pane, widen) {
  const path = new Path2D();
  const discs = stroke.points.map(([x, y], index) => {
    const radius = widen(2 * radiusAt(stroke, index) * pane.scale) / 2;
    return { x: pane.x + x * pane.scale, y: pane.y + y * pane.scale, radius };
  });
  discs.forEach((disc, index) => addHull(path, discs[Math.max(0, index - 1)], disc));
  return path;
}

// All hulls turn the same way round: where they overlap, none cuts a hole into another.
function addHull(path, one, other) {
  const apart = Math.hypot(other.x - one.x, other.y - one.y);
  const difference = one.radius - other.radius;
  if (apart <= Math.abs(difference) || apart === 0) {
    const { x, y, radius } = difference > 0 ? one : other;
    path.moveTo(x + radius, y);
    path.arc(x, y, radius, 0, 2 * Math.PI);
  } else {
    const towards = Math.atan2(other.y - one.y, other.x - one.x);
    const half = Math.acos(difference / apart);
    path.moveTo(one.x + one.radius * Math.cos(towards + half), one.y + one.radius * Math.sin(towards + half));
    path.arc(one.x, one.y, one.radius, towards + half, towards - half + 2 * Math.PI);
    path.arc(other.x, other.y, other.radius, towards - half, towards + half);
  }
  path.closePath();
}

// Gives what fills a stroke whose width in pixels of the screen is widened, or narrowed.
function fillerOf(context, stroke, pane) {
  if (stroke.pressure) return (widen) => context.fill(taperedPath(stroke, pane, widen));
  const path = pathOf(stroke, pane);
  return (widen) => {
    context.lineWidth = widen(2 * stroke.radius * pane.scale);
    context.stroke(path);
  };
}

function takeColor(context, color) {
  context.lineCap = 'round';
  context.lineJoin = 'round';
  context.strokeStyle = color;
  context.fillStyle = color;
}

// Paint as it will be: full up to hardness × radius, then fading in steps that lie over each other.
export function drawPaint(context, stroke, pane) {
  const fill = fillerOf(context, stroke, pane);
  const hardness = hardnessOf(stroke);
  const width = 2 * stroke.radius * pane.scale;
  const steps = hardness > 0.97 ? 1 : Math.min(14, Math.max(3, Math.ceil(((1 - hardness) * width) / 4)));
  const strength = stroke.erase ? 0.5 : opacityOf(stroke);
  context.save();
  takeColor(context, stroke.erase ? '#808080' : cssColor(stroke.color));
  let reached = 0;
  for (let step = 1; step <= steps; step += 1) {
    const wanted = (strength * step) / steps;
    context.globalAlpha = (wanted - reached) / (1 - Math.min(reached, 0.999));
    reached = wanted;
    fill((full) => full * (1 - (1 - hardness) * ((step - 0.5) / steps)));
  }
  context.restore();
}

// A line around the paint, light with a dark rim so that it shows on every picture. What lies below is cut out.
export function drawOutline(context, stroke, pane, { color, strength = 1, thickness = 1.25 }) {
  const fill = fillerOf(context, stroke, pane);
  const inner = (full) => Math.max(2, full);
  const line = (full) => inner(full) + 2 * thickness;
  const rim = (full) => line(full) + 1.5;
  const lay = (widen, operation, alpha) => {
    context.globalCompositeOperation = operation;
    context.globalAlpha = alpha;
    fill(widen);
  };
  context.save();
  takeColor(context, '#000');
  lay(rim, 'source-over', 0.55 * strength);
  lay(line, 'destination-out', 1);
  takeColor(context, color);
  lay(line, 'source-over', strength);
  lay(inner, 'destination-out', 1);
  context.restore();
}
