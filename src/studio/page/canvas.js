// Draws the views' pictures: the kind that is chosen, the wipe, and the hatchings of what no light reaches and where paint contradicts paint.

import { state, listen, tell } from './state.js';
import { panes, seenBox, wipeLine } from './camera.js';

const element = document.getElementById('picture-canvas');
const context = element.getContext('2d', { alpha: true });
const status = document.getElementById('status');
const veil = document.createElement('canvas');
const drawnSerials = new Map(); // of after pictures, by view
let isDue = false;
let ratio = 1;

// Draws at the next frame, however often it is asked for.
export function redraw() {
  if (isDue) return;
  isDue = true;
  requestAnimationFrame(draw);
}

export function fitCanvas(canvas, { width, height }) {
  const pixels = window.devicePixelRatio || 1;
  canvas.width = Math.max(1, Math.round(width * pixels));
  canvas.height = Math.max(1, Math.round(height * pixels));
  canvas.getContext('2d').setTransform(pixels, 0, 0, pixels, 0, 0);
  return pixels;
}

// The canvas that holds a picture, brought up to date.
export function canvasOf(kind, view) {
  const picture = state.pictures.get(`${kind}/${view}`);
  if (!picture) return null;
  if (picture.isNew) {
    picture.canvas ??= document.createElement('canvas');
    const [width, height] = picture.size;
    if (picture.canvas.width !== width || picture.canvas.height !== height) {
      picture.canvas.width = width;
      picture.canvas.height = height;
    }
    picture.canvas.getContext('2d').putImageData(new ImageData(picture.bytes, width, height), 0, 0);
    picture.bytes = null;
    picture.isNew = false;
  }
  return picture.canvas;
}

function draw() {
  isDue = false;
  context.clearRect(0, 0, state.stage.width, state.stage.height);
  context.imageSmoothingEnabled = true;
  context.imageSmoothingQuality = 'high';
  const all = panes();
  if (state.free) {
    drawFree(all[0]);
    return;
  }
  for (const place of all) drawPane(place);
  if (state.showsReach) drawHatching('coverage', all);
  if (state.showsConflicts) drawHatching('conflict', all);
  if (state.showsAll) drawLabels(all);
}

// The view's own picture stands in until the first from the free camera has come.
function drawFree(place) {
  const seen = state.free.isSeen && canvasOf('free', null);
  if (seen) context.drawImage(seen, ...pixelRect(place));
  else drawPicture('after', place);
}

function drawPane(place) {
  const { box } = place;
  context.save();
  context.beginPath();
  context.rect(box.x, box.y, box.width, box.height);
  context.clip();
  const kind = state.peeks ? 'before' : state.seen;
  if (kind === 'wipe') {
    drawPicture('after', place);
    drawWiped(place);
  } else {
    drawPicture(kind, place);
  }
  context.restore();
}

function drawWiped(place) {
  const { left, top, height } = seenBox(place);
  context.beginPath();
  context.rect(left, top, wipeLine(place) - left, height);
  context.clip();
  drawPicture('before', place);
}

// Until the chosen kind has come, what is there stands in: a black flash would be worse than a late picture.
function drawPicture(kind, place) {
  const shown = [kind, 'after', 'before'].find((each) => state.pictures.has(`${each}/${place.view}`));
  if (!shown) {
    context.fillStyle = 'rgb(128 128 128 / 12%)';
    context.fillRect(...pixelRect(place));
    return;
  }
  context.drawImage(canvasOf(shown, place.view), ...pixelRect(place));
  if (shown === 'after') noteDrawn(place.view);
}

// Whole pixels of the screen, so that edges are sharp.
function pixelRect({ x, y, size, scale }) {
  const snap = (value) => Math.round(value * ratio) / ratio;
  const [left, top] = [snap(x), snap(y)];
  return [left, top, snap(x + size[0] * scale) - left, snap(y + size[1] * scale) - top];
}

function noteDrawn(view) {
  const { serial, stage, revision } = state.pictures.get(`after/${view}`);
  if (view === state.view) {
    status.dataset.serial = serial;
    status.dataset.stage = stage;
  }
  if (drawnSerials.get(view) === serial) return;
  drawnSerials.set(view, serial);
  if (view !== state.view) return;
  if (revision > state.drawnRevision) state.drawnAt = performance.now();
  state.drawnRevision = revision;
}

// Of each hatching: its light and dark lines, which side by side show on every picture, how wide and how far apart they are, and whether
// they fall to the right.
const HATCHES = {
  coverage: { lines: ['rgb(255 255 255 / 42%)', 'rgb(0 0 0 / 45%)'], width: 1, apart: 9, falls: false },
  conflict: { lines: ['rgb(255 64 160 / 95%)', 'rgb(30 0 16 / 70%)'], width: 1.6, apart: 12, falls: true },
};

// Diagonal lines where the mask of this kind has pixels.
function drawHatching(kind, all) {
  veil.width = element.width;
  veil.height = element.height;
  const above = veil.getContext('2d');
  for (const place of all) {
    const mask = canvasOf(kind, place.view);
    if (!mask) continue;
    const { left, top, width, height } = seenBox(place);
    above.save();
    above.setTransform(ratio, 0, 0, ratio, 0, 0);
    above.beginPath();
    above.rect(left, top, width, height);
    above.clip();
    above.drawImage(mask, ...pixelRect(place));
    above.restore();
  }
  above.globalCompositeOperation = 'source-in';
  above.fillStyle = above.createPattern(hatchTile(HATCHES[kind]), 'repeat');
  above.fillRect(0, 0, veil.width, veil.height);
  context.save();
  context.setTransform(1, 0, 0, 1, 0, 0);
  context.drawImage(veil, 0, 0);
  context.restore();
}

function hatchTile({ lines: [light, dark], width, apart, falls }) {
  const side = Math.round(apart * ratio);
  const tile = document.createElement('canvas');
  tile.width = side;
  tile.height = side;
  const pen = tile.getContext('2d');
  if (falls) pen.setTransform(-1, 0, 0, 1, side, 0);
  pen.lineWidth = width * ratio;
  for (const [color, shift] of [[light, 0], [dark, 1.3 * width * ratio]]) {
    pen.strokeStyle = color;
    pen.beginPath();
    for (const turn of [-side, 0, side]) {
      pen.moveTo(turn + shift - side, 2 * side);
      pen.lineTo(turn + shift + 2 * side, -side);
    }
    pen.stroke();
  }
  return tile;
}

function drawLabels(all) {
  const style = getComputedStyle(document.documentElement);
  context.font = `13px ${style.fontFamily}`;
  context.textBaseline = 'alphabetic';
  for (const { view, box, size, scale } of all) {
    const isActive = view === state.view;
    context.fillStyle = getComputedStyle(isActive ? element : element.parentElement).color;
    const left = Math.max(box.x, box.x + (box.width - size[0] * scale) / 2);
    const top = Math.max(box.y, box.y + (box.height - size[1] * scale) / 2);
    context.fillText(state.views[view].name, left, top - 8, box.width);
  }
}

export function watchStage(container, canvases) {
  const resize = () => {
    const { width, height } = container.getBoundingClientRect();
    state.stage = { width, height };
    for (const canvas of canvases) ratio = fitCanvas(canvas, state.stage);
    tell('camera');
    // At once: a canvas whose size was set is empty until it is drawn.
    draw();
  };
  new ResizeObserver(resize).observe(container);
  resize();
}

listen('camera scene seeing view theme free wipe', redraw);
listen('picture', ({ kind }) => {
  if (kind !== 'light_map') redraw();
});
