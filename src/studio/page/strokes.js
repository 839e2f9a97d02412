// Geometry of strokes, and how they are drawn on a canvas.

import { cssColor } from './colour.js';

const MAX_POINTS = 10000;

// What the scene file leaves out stands for these values.
export const hardnessOf = (stroke) => stroke.hardness ?? 0.8;
export const opacityOf = (stroke) => stroke.opacity ?? 1;

export const rounded = (value) => Math.round(value * 100) / 100;

// Adds a point unless it is too near to the last one to matter.
export function addPoint(points, point, radius) {
  const last = points.at(-1);
  if (last && distance(last, point) < Math.max(0.75, radius / 8)) return;
  points.push(point);
  if (points.length > MAX_POINTS) thinOut(points);
}

// A very long stroke loses every second point, never its first.
function thinOut(points) {
  const kept = points.filter((_, index) => index % 2 === 0);
  points.splice(0, points.length, ...kept);
}

export function distance([x, y], [u, v]) {
  return Math.hypot(u - x, v - y);
}

function distanceToPart(point, start, end) {
  const along = [end[0] - start[0], end[1] - start[1]];
  const square = along[0] ** 2 + along[1] ** 2;
  const product = (point[0] - start[0]) * along[0] + (point[1] - start[1]) * along[1];
  const part = square > 0 ? Math.min(1, Math.max(0, product / square)) : 0;
  return distance(point, [start[0] + part * along[0], start[1] + part * along[1]]);
}

export function distanceToStroke(point, stroke) {
  const { points } = stroke;
  let nearest = distance(point, points[0]);
  for (let i = 1; i < points.length; i += 1) {
    nearest = Math.min(nearest, distanceToPart(point, points[i - 1], points[i]));
  }
  return nearest;
}

// The server refuses strokes that lie wholly outside of the picture.
export function touchesPicture({ points, radius }, size) {
  return points.some((point, index) => crosses(points[Math.max(0, index - 1)], point, radius, size));
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

function roundPen(context) {
  context.lineCap = 'round';
  context.lineJoin = 'round';
}

// Paint as it will be: full up to hardness × radius, then fading in steps that lie over each other.
export function drawPaint(context, stroke, pane) {
  const path = pathOf(stroke, pane);
  const hardness = hardnessOf(stroke);
  const width = 2 * stroke.radius * pane.scale;
  const steps = hardness > 0.97 ? 1 : Math.min(14, Math.max(3, Math.ceil(((1 - hardness) * width) / 4)));
  const strength = stroke.erase ? 0.5 : opacityOf(stroke);
  context.save();
  roundPen(context);
  context.strokeStyle = stroke.erase ? '#808080' : cssColor(stroke.color);
  let reached = 0;
  for (let step = 1; step <= steps; step += 1) {
    const wanted = (strength * step) / steps;
    context.globalAlpha = (wanted - reached) / (1 - Math.min(reached, 0.999));
    reached = wanted;
    context.lineWidth = width * (1 - (1 - hardness) * ((step - 0.5) / steps));
    context.stroke(path);
  }
  context.restore();
}

// A line around the paint, light with a dark rim so that it shows on every picture. What lies below is cut out.
export function drawOutline(context, stroke, pane, { color, strength = 1, thickness = 1.25 }) {
  const path = pathOf(stroke, pane);
  const width = Math.max(2, 2 * stroke.radius * pane.scale);
  context.save();
  roundPen(context);
  context.globalAlpha = 0.55 * strength;
  context.strokeStyle = '#000';
  context.lineWidth = width + 2 * thickness + 1.5;
  context.stroke(path);
  context.globalCompositeOperation = 'destination-out';
  context.globalAlpha = 1;
  context.lineWidth = width + 2 * thickness;
  context.stroke(path);
  context.globalCompositeOperation = 'source-over';
  context.globalAlpha = strength;
  context.strokeStyle = color;
  context.stroke(path);
  context.globalCompositeOperation = 'destination-out';
  context.globalAlpha = 1;
  context.lineWidth = width;
  context.stroke(path);
  context.restore();
}
