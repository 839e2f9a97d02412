// Draws what lies over the pictures: outlines of strokes, the stroke under way, the brush's ring and the wipe's handle.

import { state, listen } from './state.js';
import { activePane, paneAt, panes, seenBox, wipeLine } from './camera.js';
import { paintInHand, selectedStroke } from './actions.js';
import { strokeUnderWay } from './brush.js';
import { cssColor } from './colour.js';
import { isShown } from './groups.js';
import { drawPoint, isInHand, pointsIn } from './points.js';
import { drawOutline, drawPaint, hardnessOf } from './strokes.js';

export const GRIP_RADIUS = 15;
const SIZE_SHOWN_MS = 900;

const marks = document.getElementById('marks-canvas').getContext('2d');
const live = document.getElementById('view-canvas').getContext('2d');
let marksAreDue = true;
let isDue = false;
let sizeShownUntil = 0;

export function redrawLive() {
  if (isDue) return;
  isDue = true;
  requestAnimationFrame(draw);
}

function redrawMarks() {
  marksAreDue = true;
  redrawLive();
}

function draw() {
  isDue = false;
  const all = panes();
  if (marksAreDue) drawMarks(all);
  live.clearRect(0, 0, state.stage.width, state.stage.height);
  if (state.free) return;
  for (const place of all) inside(live, place, () => drawUnderWay(place));
  if (state.seen === 'wipe' && !state.peeks) for (const place of all) drawWipe(place);
  drawPointer();
}

function inside(context, { box }, run) {
  context.save();
  context.beginPath();
  context.rect(box.x, box.y, box.width, box.height);
  context.clip();
  run();
  context.restore();
}

// Outlines change seldom and cost much: they have a canvas of their own.
function drawMarks(all) {
  marksAreDue = false;
  marks.clearRect(0, 0, state.stage.width, state.stage.height);
  if (!state.free) for (const place of all) inside(marks, place, () => drawMarksOf(place));
}

function drawMarksOf(place) {
  const { view } = place;
  if (state.showsOutlines) {
    for (const stroke of (state.strokes[view] ?? []).filter(isShown)) drawOutline(marks, stroke, place, { color: lineColor(stroke) });
  }
  for (const entry of state.pending) {
    if (entry.view === view) drawPaint(marks, entry.stroke, place);
  }
  if (state.showsPoints) {
    for (const { layer, number, point } of pointsIn(view)) {
      const [x, y] = point.pixel.map((value, axis) => (axis === 0 ? place.x : place.y) + value * place.scale);
      drawPoint(marks, x, y, point, isInHand(layer, number));
    }
  }
  const veil = state.asks?.veil?.(view);
  if (veil) {
    const [width, height] = state.views[view].size;
    marks.drawImage(veil, place.x, place.y, width * place.scale, height * place.scale);
  }
  if (state.selection?.view === view && !state.draft) drawSelected(marks, selectedStroke(), place);
}

const lineColor = (stroke) => (stroke.erase ? '#b0b0b0' : cssColor(stroke.color));

function drawSelected(context, stroke, place) {
  if (!stroke) return;
  drawOutline(context, stroke, place, { color: '#fff', thickness: 2 });
}

function drawUnderWay(place) {
  if (state.draft?.view === place.view) {
    drawSelected(live, state.draft.stroke, place);
    live.globalAlpha = 1;
    drawPaint(live, state.draft.stroke, place);
  }
  const inAir = state.asks?.path?.(place.view);
  if (inAir) drawPaint(live, inAir, place);
  if (state.live?.view === place.view) {
    drawPaint(live, strokeUnderWay(state.live), place);
  }
}

function drawWipe(place) {
  const { top, height, width } = seenBox(place);
  if (width <= 0 || height <= 0) return;
  const x = wipeLine(place);
  const y = top + height / 2;
  twoTone(live, 1.5, () => {
    live.moveTo(x, top);
    live.lineTo(x, top + height);
  });
  live.beginPath();
  live.arc(x, y, GRIP_RADIUS, 0, 2 * Math.PI);
  live.fillStyle = 'rgb(24 24 24 / 82%)';
  live.fill();
  live.lineWidth = 1.5;
  live.strokeStyle = '#fff';
  live.stroke();
  live.beginPath();
  for (const side of [-1, 1]) {
    live.moveTo(x + side * 4, y - 4);
    live.lineTo(x + side * 8, y);
    live.lineTo(x + side * 4, y + 4);
  }
  live.stroke();
  inside(live, place, () => {
    drawTag('Before', x - 10, top + 10, 'right');
    drawTag('After', x + 10, top + 10, 'left');
  });
}

function drawTag(text, x, y, align) {
  live.font = `12px ${getComputedStyle(document.documentElement).fontFamily}`;
  const width = live.measureText(text).width + 14;
  live.fillStyle = 'rgb(24 24 24 / 72%)';
  live.beginPath();
  live.roundRect(align === 'right' ? x - width : x, y, width, 20, 10);
  live.fill();
  live.fillStyle = '#fff';
  live.textBaseline = 'middle';
  live.textAlign = align;
  live.fillText(text, align === 'right' ? x - 7 : x + 7, y + 10.5);
}

// Dark below light: such lines show on every picture.
function twoTone(context, width, trace) {
  for (const [color, extra] of [['rgb(0 0 0 / 55%)', 1.75], ['rgb(255 255 255 / 95%)', 0]]) {
    context.beginPath();
    trace();
    context.strokeStyle = color;
    context.lineWidth = width + extra;
    context.stroke();
  }
}

function drawPointer() {
  const { pointer } = state;
  const isSizing = performance.now() < sizeShownUntil;
  if (!pointer && isSizing) {
    const place = activePane();
    if (place) drawRing(place, place.box.x + place.box.width / 2, place.box.y + place.box.height / 2);
  }
  if (!pointer || state.spaceHeld || pointer.isOnWipe) return;
  const place = paneAt(pointer);
  if (!place) return;
  if (state.asks) {
    if (state.asks.ring) drawRing(place, pointer.x, pointer.y, state.asks.ring(place.view));
    return;
  }
  if (state.tool === 'pick' || state.altHeld) drawLoupe(pointer);
  else if (state.tool !== 'select' || isSizing) drawRing(place, pointer.x, pointer.y);
}

// The edge of the paint, and fainter the edge of its full strength.
function drawRing(place, x, y, ring = null) {
  const paint = ring ?? paintInHand();
  const radius = paint.radius * place.scale;
  const hardness = ring ? ring.hardness : hardnessOf(paint);
  twoTone(live, 1.25, () => live.arc(x, y, Math.max(2, radius), 0, 2 * Math.PI));
  if (radius * hardness > 4 && radius * (1 - hardness) > 3) {
    live.beginPath();
    live.arc(x, y, radius * hardness, 0, 2 * Math.PI);
    live.strokeStyle = 'rgb(255 255 255 / 40%)';
    live.lineWidth = 1;
    live.stroke();
  }
}

// A ring of the colour in hand around the place from which one is taken.
function drawLoupe({ x, y }) {
  live.beginPath();
  live.arc(x, y, 22, 0, 2 * Math.PI);
  live.strokeStyle = cssColor(paintInHand().color);
  live.lineWidth = 9;
  live.stroke();
  for (const radius of [17, 27]) twoTone(live, 1, () => live.arc(x, y, radius, 0, 2 * Math.PI));
}

listen('camera scene strokes groups selection marks seeing view looks', redrawMarks);
listen('picture', ({ kind }) => {
  if (kind === 'after') redrawMarks();
});
listen('brush tool wipe pointer live asks air', redrawLive);
listen('asks', redrawMarks);
listen('brush', (change) => {
  if (!change || !('radius' in change || 'hardness' in change)) return;
  sizeShownUntil = performance.now() + SIZE_SHOWN_MS;
  setTimeout(redrawLive, SIZE_SHOWN_MS + 20);
});
