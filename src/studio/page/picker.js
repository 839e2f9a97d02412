// A picker of colours: the square of saturation and brightness, the hue, the hex field and the swatches.

import { state } from './state.js';
import { cssColor, hexOfHsv, hsvOf, parseHex } from './colour.js';
import { fitCanvas } from './canvas.js';

const OWN_PLACES = 8;
const HANDLE = 7; // pixels

const STEPS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };

const unit = (value) => Math.min(1, Math.max(0, value));

// The parts of `root` are named by `data-part`. `read` gives the colour that is picked, `take` gets another one, and `commit` hears that a
// drag has ended, `begin` that one begins.
export function makePicker(root, { read, take, begin = () => {}, commit = () => {} }) {
  const [shade, hue, hex, chip, palette, recent] = ['shade', 'hue', 'hex', 'chip', 'palette', 'recent']
    .map((name) => root.querySelector(`[data-part=${name}]`));
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
    const color = cssColor(read());
    follow(color);
    if (document.activeElement !== hex) hex.value = color;
    hex.classList.remove('is-wrong');
    hue.value = Math.round(hsv.hue);
    chip.style.backgroundColor = color;
    const percent = (part) => `${Math.round(part * 100)} %`;
    shade.setAttribute('aria-valuetext', `saturation ${percent(hsv.saturation)}, brightness ${percent(hsv.value)}`);
    shade.setAttribute('aria-valuenow', Math.round(hsv.value * 100));
    for (const swatch of root.querySelectorAll('.swatch')) {
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

  function turn(change) {
    hsv = { ...hsv, ...change };
    take(hexOfHsv(hsv));
  }

  function dragShade(event) {
    if (event.buttons === 0) return;
    const box = shade.getBoundingClientRect();
    turn({ saturation: unit((event.clientX - box.left) / box.width), value: unit(1 - (event.clientY - box.top) / box.height) });
  }

  function stepShade(event) {
    const step = STEPS[event.key];
    if (!step) return;
    event.preventDefault();
    const far = event.shiftKey ? 0.1 : 0.02;
    turn({ saturation: unit(hsv.saturation + step[0] * far), value: unit(hsv.value + step[1] * far) });
  }

  function swatchOf(color) {
    const swatch = document.createElement('button');
    swatch.className = 'swatch';
    swatch.dataset.color = color;
    swatch.style.backgroundColor = color;
    swatch.title = color;
    swatch.setAttribute('aria-label', `Colour ${color}`);
    swatch.addEventListener('click', () => {
      begin();
      take(color);
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
    palette.replaceChildren(...colors.map(swatchOf));
    showOwn();
  }

  function showOwn() {
    const places = state.ownColors.map(swatchOf);
    while (places.length < OWN_PLACES) places.push(emptyPlace());
    recent.replaceChildren(...places);
    show();
  }

  shade.addEventListener('pointerdown', (event) => {
    shade.setPointerCapture(event.pointerId);
    begin();
    dragShade(event);
  });
  shade.addEventListener('pointermove', dragShade);
  shade.addEventListener('pointerup', commit);
  shade.addEventListener('keydown', stepShade);
  hue.addEventListener('pointerdown', begin);
  hue.addEventListener('input', () => turn({ hue: Number(hue.value) }));
  hue.addEventListener('change', commit);
  hex.addEventListener('input', () => {
    const color = parseHex(hex.value);
    hex.classList.toggle('is-wrong', !color);
    // Three digits may be on their way to six.
    if (color && hex.value.replace('#', '').length === 6) take(color);
  });
  hex.addEventListener('change', () => {
    const color = parseHex(hex.value);
    if (color) take(color);
    commit();
    hex.value = cssColor(read());
    hex.classList.remove('is-wrong');
  });
  new ResizeObserver(() => {
    const { width, height } = shade.getBoundingClientRect();
    size = { width, height };
    fitCanvas(shade, size);
    drawShade();
  }).observe(shade);
  return { show, showPalette, showOwn };
}
