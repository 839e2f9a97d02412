// The sun, on a dial that shows the sky from above, and the fog.

import { state, listen } from './state.js';
import { isOpen } from './socket.js';
import { makeSender, whenSettled } from './sender.js';
import { byId, showFill } from './dom.js';
import { fitCanvas } from './canvas.js';

const SIDE = 96; // pixels
const RIM = SIDE / 2 - 9;
const HANDLE = 7;
const SUNLIGHT = '#f7b04e';
const LOWEST = 89; // degrees from straight above
const THINNEST = 0.02; // optical depths
const THICKEST = 8;
const STEPS = 1000;

const dial = byId('sun');
const fog = byId('fog');
const context = dial.getContext('2d');
const degrees = (radians) => (radians * 180) / Math.PI;
const radians = (angle) => (angle * Math.PI) / 180;
const clamp = (value, low, high) => Math.min(high, Math.max(low, value));

let sky = { turn: 0, height: 45 }; // degrees: where the sun stands, to the right from the top of the dial (−z), and above the ground

const sun = makeSender('sun');
const depth = makeSender('fog');
const isBusy = () => sun.isBusy() || depth.isBusy() || dial.matches(':active') || fog.matches(':active');

function takeLook(look) {
  state.look = look;
  if (look.sun) sky = skyOf(look.sun);
  show();
}

function skyOf([x, y, z]) {
  const flat = Math.hypot(x, z);
  const turn = flat > 1e-6 * Math.abs(y) ? (degrees(Math.atan2(-x, z)) + 360) % 360 : sky.turn;
  return { turn, height: degrees(Math.atan2(-y, flat)) };
}

function directionOf({ turn, height }) {
  const [around, up] = [radians(turn), radians(height)];
  return [-Math.sin(around) * Math.cos(up), -Math.sin(up), Math.cos(around) * Math.cos(up)].map((part) => Number(part.toFixed(5)));
}

function turnSun(change) {
  if (!isOpen()) return;
  sky = { ...sky, ...change };
  sun.push({ direction: directionOf(sky) });
  show();
}

const heightAt = (away) => 90 - Math.min(LOWEST, (90 * away) / RIM);

function dragSun(event) {
  if (event.buttons === 0) return;
  const box = dial.getBoundingClientRect();
  const [x, y] = [event.clientX - box.left - box.width / 2, event.clientY - box.top - box.height / 2];
  const away = Math.hypot(x, y);
  sun.hold();
  turnSun({ height: heightAt(away), ...(away > 2 ? { turn: (degrees(Math.atan2(x, -y)) + 360) % 360 } : {}) });
}

const KEYS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };

function stepSun(event) {
  const step = KEYS[event.key];
  if (!step || event.ctrlKey || event.altKey) return;
  event.preventDefault();
  const far = event.shiftKey ? 10 : 2;
  turnSun({ turn: (sky.turn + step[0] * far + 360) % 360, height: clamp(sky.height + step[1] * far, 90 - LOWEST, 90) });
}

function show() {
  const { sun: direction, sigma_t: thickness, span } = state.look;
  byId('light-section').hidden = direction === null && thickness === null;
  byId('sun-box').hidden = direction === null;
  byId('fog-box').hidden = thickness === null;
  if (direction !== null) showSun();
  if (thickness !== null && !fog.matches(':active')) showFog(thickness * span);
}

function showSun() {
  const height = `${Math.round(sky.height)}°`.replace('-', '−');
  const turn = `${Math.round(sky.turn) % 360}°`;
  byId('sun-height').textContent = height;
  byId('sun-turn').textContent = turn;
  dial.setAttribute('aria-valuenow', Math.round(sky.height));
  dial.setAttribute('aria-valuetext', `${height} high, from ${turn}`);
  drawDial();
}

function drawDial() {
  const { color, backgroundColor, accentColor } = getComputedStyle(dial);
  const middle = SIDE / 2;
  const ring = (radius, strength) => {
    context.beginPath();
    context.arc(middle, middle, radius, 0, 2 * Math.PI);
    context.globalAlpha = strength;
    context.stroke();
  };
  context.clearRect(0, 0, SIDE, SIDE);
  context.lineWidth = 1;
  context.strokeStyle = color;
  context.fillStyle = color;
  drawSight();
  for (const part of [1 / 3, 2 / 3]) ring(RIM * part, 0.35);
  ring(RIM, 1);
  const away = (RIM * clamp(90 - sky.height, 0, 90)) / 90;
  const [x, y] = [middle + Math.sin(radians(sky.turn)) * away, middle - Math.cos(radians(sky.turn)) * away];
  context.beginPath();
  context.moveTo(x, y);
  context.lineTo(middle, middle);
  context.strokeStyle = accentColor;
  context.lineWidth = 1.5;
  context.stroke();
  context.beginPath();
  context.arc(x, y, HANDLE, 0, 2 * Math.PI);
  // Light from below the ground: hollow, on the rim.
  context.fillStyle = sky.height < 0 ? backgroundColor : SUNLIGHT;
  context.fill();
  context.lineWidth = 2;
  context.stroke();
}

// Where the view looks: without it nobody knows which way the dial lies.
function drawSight() {
  const { view, camera } = state.free ?? { view: state.view, camera: state.views[state.view]?.camera };
  if (!camera) return;
  const [width, height] = state.views[view].size;
  const [x, z] = [camera.target[0] - camera.origin[0], camera.target[2] - camera.origin[2]];
  if (Math.hypot(x, z) < 1e-9) return;
  const towards = Math.atan2(z, x);
  const half = Math.atan((Math.tan(radians(camera.fov) / 2) * width) / height);
  context.beginPath();
  context.moveTo(SIDE / 2, SIDE / 2);
  context.arc(SIDE / 2, SIDE / 2, RIM, towards - half, towards + half);
  context.closePath();
  context.globalAlpha = 0.25;
  context.fill();
}

const depthAt = (step) => THINNEST * (THICKEST / THINNEST) ** (step / STEPS);
const stepOf = (value) => (STEPS * Math.log(value / THINNEST)) / Math.log(THICKEST / THINNEST);

function showFog(value) {
  fog.value = stepOf(value);
  const text = value >= 100 ? `${Math.round(value)}` : value.toPrecision(2);
  byId('fog-value').textContent = text;
  fog.setAttribute('aria-valuetext', `optical depth ${text}`);
  showFill(fog);
}

function dragFog() {
  if (!isOpen()) return;
  const value = depthAt(Number(fog.value));
  if (fog.matches(':active')) depth.hold();
  state.look = { ...state.look, sigma_t: Number((value / state.look.span).toPrecision(4)) };
  depth.push({ sigma_t: state.look.sigma_t });
  showFog(value);
}

export function watchLight() {
  dial.style.width = `${SIDE}px`;
  dial.style.height = `${SIDE}px`;
  fitCanvas(dial, { width: SIDE, height: SIDE });
  dial.addEventListener('pointerdown', (event) => {
    if (event.button !== 0) return;
    dial.setPointerCapture(event.pointerId);
    sun.begin();
    dragSun(event);
  });
  dial.addEventListener('pointermove', dragSun);
  dial.addEventListener('keydown', stepSun);
  fog.addEventListener('pointerdown', depth.begin);
  fog.addEventListener('input', dragFog);
  listen('look', whenSettled(isBusy, takeLook));
  listen('theme view scene free', () => {
    if (state.look.sun) drawDial();
  });
  show();
}
