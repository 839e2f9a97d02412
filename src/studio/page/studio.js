// Start: wires the parts together, connects, and sets up the brush when the scene is known.

import { state, listen, tell, recall } from './state.js';
import { activePane } from './camera.js';
import { largestRadius } from './actions.js';
import { redraw, watchStage } from './canvas.js';
import { redrawLive } from './overlay.js';
import { watchPointer } from './pointer.js';
import { watchTools } from './tools.js';
import { watchPalette } from './palette.js';
import { watchGroups } from './groups.js';
import { watchLight } from './light.js';
import { watchLooks } from './looks.js';
import { watchEdits } from './edits.js';
import { watchTransfer } from './transfer.js';
import { watchTable } from './table.js';
import { watchAir } from './air.js';
import { watchSurfaces } from './surfaces.js';
import { watchFree } from './free.js';
import { watchViews } from './views.js';
import { watchStatus } from './status.js';
import { watchToasts } from './toasts.js';
import { watchKeys } from './keys.js';
import { connect, unsentCount } from './socket.js';

// A brush that fits the picture, where none is remembered.
function setUpBrush() {
  const { brush } = state;
  if (!brush.radius) brush.radius = Math.max(2, Math.round(Math.max(...state.views.flatMap(({ size }) => size)) / 64));
  brush.radius = Math.min(brush.radius, largestRadius());
  tell('brush');
}

// Where a point of the active view's picture lies on the page: for tests that paint.
function toScreen(x, y) {
  const place = activePane();
  const box = document.getElementById('view-canvas').getBoundingClientRect();
  return { x: box.left + place.x + x * place.scale, y: box.top + place.y + y * place.scale };
}

recall();
watchTools();
watchPalette();
watchGroups();
watchLight();
watchLooks();
watchEdits();
watchTransfer();
watchTable();
watchAir();
watchSurfaces();
watchViews();
watchStatus();
watchToasts();
watchKeys();
watchPointer();
watchFree();
const layers = ['picture-canvas', 'marks-canvas', 'view-canvas'].map((id) => document.getElementById(id));
watchStage(document.getElementById('pictures'), layers);
listen('scene', setUpBrush);
listen('theme', redrawLive);
window.addEventListener('beforeunload', (event) => {
  // The server has all that was sent; only what waits for it would be lost.
  if (unsentCount() > 0) event.preventDefault();
});
window.studio = { state, toScreen };
redraw();
connect();
