// The table of the transfer function: its colours, and the points on it, which are added, dragged and removed here.

import { state, listen } from './state.js';
import { canvasOf, fitCanvas } from './canvas.js';
import { beginDrag, choosePoint, drag } from './looks.js';
import { addPoint, openLayer, removePoint } from './transfer.js';
import { axesOf, drawPoint, isInHand, placedPoints, pointsOf, RADIUS, WORDS } from './points.js';
import { byId } from './dom.js';

const NEAR = 10; // pixels
const STILL = 3;
const STEP = 0.02;

const table = byId('table');
const context = table.getContext('2d');
let size = { width: 0, height: 0 };
let press = null; // { x, y, isDrag }: where it was, and whether it has become a drag

const clamp = (value) => Math.min(1, Math.max(0, value));
const digits = (value) => Math.round(clamp(value) * 1000) / 1000;

function placeOf(event) {
  const box = table.getBoundingClientRect();
  return [(event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height].map(digits);
}

function pointAt([x, y]) {
  const away = ({ at }) => Math.hypot((at[0] - x) * size.width, (at[1] - y) * size.height);
  // The one in hand first, then those that are drawn last.
  const all = placedPoints().toReversed().sort((a, b) => isInHand(b.layer, b.number) - isInHand(a.layer, a.number));
  return all.find((point) => away(point) <= NEAR);
}

function choose({ layer, number }) {
  state.point = { layer, number };
  openLayer(layer);
  choosePoint(state.point);
}

// A point that was given by what a view sees is at a place of the table from now on.
function moveTo(at) {
  const { layer, number } = state.point;
  drag(({ transfer: { layers } }) => {
    const { view, pixel, triangle, corners, ...rest } = layers[layer].diffusion.points[number];
    layers[layer].diffusion.points[number] = { ...rest, at };
  });
}

function pressed(event) {
  if (event.button !== 0) return;
  table.setPointerCapture(event.pointerId);
  press = { x: event.clientX, y: event.clientY, isDrag: false };
  const at = placeOf(event);
  const point = pointAt(at);
  beginDrag();
  if (point) choose(point);
  else addPoint({ color: state.brush.color, at });
}

function dragged(event) {
  if (event.buttons === 0 || !state.point || !press) return;
  // A click may slip a little.
  press.isDrag ||= Math.hypot(event.clientX - press.x, event.clientY - press.y) >= STILL;
  if (press.isDrag) moveTo(placeOf(event));
}

const KEYS = { ArrowLeft: [-STEP, 0], ArrowRight: [STEP, 0], ArrowUp: [0, -STEP], ArrowDown: [0, STEP] };

function stepped(event) {
  if (event.ctrlKey || event.altKey) return;
  if (event.key === 'Enter') addPoint({ color: state.brush.color, at: [0.5, 0.5] });
  else if (event.key === 'Delete' || event.key === 'Backspace') removePoint();
  else if (KEYS[event.key] && state.point) {
    const place = placedPoints().find(({ layer, number }) => isInHand(layer, number));
    if (place) moveTo(place.at.map((value, axis) => digits(value + KEYS[event.key][axis] * (event.shiftKey ? 5 : 1))));
  } else return;
  event.preventDefault();
  event.stopPropagation();
}

function draw() {
  const { width, height } = size;
  context.clearRect(0, 0, width, height);
  const seen = canvasOf('transfer', null);
  context.imageSmoothingQuality = 'high';
  if (seen) context.drawImage(seen, 0, 0, width, height);
  for (const { layer, number, point, at } of placedPoints()) {
    // Whole also at the rim.
    const within = (value, side) => Math.min(side - RADIUS - 2, Math.max(RADIUS + 2, value * side));
    drawPoint(context, within(at[0], width), within(at[1], height), point, isInHand(layer, number));
  }
}

function show() {
  const [across, down] = axesOf().map((axis) => WORDS[axis] ?? { from: axis, to: '' });
  byId('table-left').textContent = across.from;
  byId('table-right').textContent = across.to;
  byId('table-top').textContent = down.from;
  byId('table-bottom').textContent = down.to;
  table.setAttribute('aria-valuetext', state.point ? `point ${state.point.number + 1} of ${pointsOf(state.point.layer).length}` : '');
  draw();
}

export function watchTable() {
  table.addEventListener('pointerdown', pressed);
  table.addEventListener('pointermove', dragged);
  table.addEventListener('keydown', stepped);
  new ResizeObserver(() => {
    const { width, height } = table.getBoundingClientRect();
    size = { width, height };
    fitCanvas(table, size);
    draw();
  }).observe(table);
  listen('table theme', show);
  listen('picture', ({ kind }) => kind === 'transfer' && draw());
}
