// Colours: the square of saturation and brightness, the hue, the hex field and the swatches.

import { state, listen } from './state.js';
import { chooseColor, commit, paintInHand } from './actions.js';
import { cssColor, hexOfHsv, hsvOf, parseHex } from './colour.js';
import { fitCanvas } from './canvas.js';

const OWN_PLACES = 8;
const HANDLE = 7; // pixels

const shade = document.getElementById('shade');
const hue = document.getElementById('hue');
const hex = document.getElementById('hex');
const chip = document.getElementById('chip');
const context = shade.getContext('2d');

// Grey has no hue and black no saturation: the last ones are kept, so that the handles stay where they were.
let hsv = { hue: 30, saturation: 0, value: 1 };
let size = { width: 0, height: 0 };

function follow(color) {
  const now = hsvOf(color);
  if (hexOfHsv(hsv) === color) return;
  if (now.saturation === 0 || now.value === 0) now.hue = hsv.hue;
  if (now.value === 0) now.saturation = hsv.saturation;
  hsv = now;
}

function show() {
  const color = cssColor(paintInHand().color);
  follow(color);
  if (document.activeElement !== hex) hex.value = color;
  hex.classList.remove('is-wrong');
  hue.value = Math.round(hsv.hue);
  chip.style.backgroundColor = color;
  const percent = (part) => `${Math.round(part * 100)} %`;
  shade.setAttribute('aria-valuetext', `saturation ${percent(hsv.saturation)}, brightness ${percent(hsv.value)}`);
  shade.setAttribute('aria-valuenow', Math.round(hsv.value * 100));
  for (const swatch of document.querySelectorAll('.swatch')) {
    swatch.setAttribute('aria-pressed', swatch.dataset.color === color);
  }
  drawShade();
}

function drawShade() {
  const { width, height } = size;
  context.fillStyle = hexOfHsv({ hue: hsv.hue, saturation: 1, value: 1 });
  context.fillRect(0, 0, width, height);
  for (const [color, end] of [['255 255 255', [width, 0]], ['0 0 0', [0, -height]]]) {
    const gradient = context.createLinearGradient(0, end[1] < 0 ? height : 0, end[0], 0);
    gradient.addColorStop(0, `rgb(${color})`);
    gradient.addColorStop(1, `rgb(${color} / 0%)`);
    context.fillStyle = gradient;
    context.fillRect(0, 0, width, height);
  }
  // The handle stays whole, also in the corners.
  const within = (share, side) => Math.min(side - HANDLE - 2, Math.max(HANDLE + 2, share * side));
  const [x, y] = [within(hsv.saturation, width), within(1 - hsv.value, height)];
  for (const [color, line] of [['rgb(0 0 0 / 60%)', 4.5], ['#fff', 2]]) {
    context.beginPath();
    context.arc(x, y, HANDLE, 0, 2 * Math.PI);
    context.strokeStyle = color;
    context.lineWidth = line;
    context.stroke();
  }
}

function take(change) {
  hsv = { ...hsv, ...change };
  chooseColor(hexOfHsv(hsv));
}

const part = (value) => Math.min(1, Math.max(0, value));

function dragShade(event) {
  if (event.buttons === 0) return;
  const box = shade.getBoundingClientRect();
  take({ saturation: part((event.clientX - box.left) / box.width), value: part(1 - (event.clientY - box.top) / box.height) });
}

const STEPS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };

function stepShade(event) {
  const step = STEPS[event.key];
  if (!step) return;
  event.preventDefault();
  const far = event.shiftKey ? 0.1 : 0.02;
  take({ saturation: part(hsv.saturation + step[0] * far), value: part(hsv.value + step[1] * far) });
}

function swatchOf(color) {
  const swatch = document.createElement('button');
  swatch.className = 'swatch';
  swatch.dataset.color = color;
  swatch.style.backgroundColor = color;
  swatch.title = color;
  swatch.setAttribute('aria-label', `Colour ${color}`);
  swatch.addEventListener('click', () => {
    chooseColor(color);
    commit();
  });
  return swatch;
}

function emptyPlace() {
  const place = document.createElement('span');
  place.className = 'swatch is-empty';
  return place;
}

// White and black are always there: the light as it is, and none.
function showPalette() {
  const colors = [...new Set([...(state.scene?.palette ?? []).map(cssColor), '#ffffff', '#000000'])];
  document.getElementById('palette').replaceChildren(...colors.map(swatchOf));
  showOwn();
}

function showOwn() {
  const places = state.ownColors.map(swatchOf);
  while (places.length < OWN_PLACES) places.push(emptyPlace());
  document.getElementById('recent').replaceChildren(...places);
  show();
}

export function watchPalette() {
  shade.addEventListener('pointerdown', (event) => {
    shade.setPointerCapture(event.pointerId);
    dragShade(event);
  });
  shade.addEventListener('pointermove', dragShade);
  shade.addEventListener('pointerup', commit);
  shade.addEventListener('keydown', stepShade);
  hue.addEventListener('input', () => take({ hue: Number(hue.value) }));
  hue.addEventListener('change', commit);
  hex.addEventListener('input', () => {
    const color = parseHex(hex.value);
    hex.classList.toggle('is-wrong', !color);
    // Three digits may be on their way to six.
    if (color && hex.value.replace('#', '').length === 6) chooseColor(color);
  });
  hex.addEventListener('change', () => {
    const color = parseHex(hex.value);
    if (color) chooseColor(color);
    commit();
    hex.value = cssColor(paintInHand().color);
    hex.classList.remove('is-wrong');
  });
  new ResizeObserver(() => {
    const { width, height } = shade.getBoundingClientRect();
    size = { width, height };
    fitCanvas(shade, size);
    drawShade();
  }).observe(shade);
  listen('brush selection', show);
  listen('scene', showPalette);
  listen('colors', showOwn);
  showPalette();
}
