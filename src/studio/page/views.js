// The strip of views below the picture, and the panel with the light map.

import { state, listen } from './state.js';
import { chooseView } from './actions.js';
import { canvasOf, fitCanvas } from './canvas.js';

const strip = document.getElementById('views');
const panel = document.getElementById('light-map');
const map = document.getElementById('light-map-canvas');
const THUMB_HEIGHT = 52;

const stale = new Set(); // views whose thumbs are to be drawn
let isDue = false;

function makeTabs() {
  strip.hidden = state.views.length < 2;
  strip.replaceChildren(...state.views.map(makeTab));
  showTabs();
  for (let view = 0; view < state.views.length; view += 1) askThumb(view);
}

function makeTab({ name, size }, view) {
  const tab = document.createElement('button');
  tab.className = 'view';
  tab.title = view < 9 ? `${name} (${view + 1})` : name;
  const thumb = document.createElement('canvas');
  const width = Math.min(140, Math.max(30, (THUMB_HEIGHT * size[0]) / size[1]));
  thumb.style.width = `${width}px`;
  fitCanvas(thumb, { width, height: THUMB_HEIGHT });
  const text = document.createElement('span');
  text.className = 'view-text';
  const label = document.createElement('span');
  label.className = 'view-name';
  label.textContent = name;
  const count = document.createElement('span');
  count.className = 'view-count';
  text.append(label, count);
  tab.append(thumb, text);
  tab.addEventListener('click', () => chooseView(view));
  return tab;
}

function showTabs() {
  [...strip.children].forEach((tab, view) => {
    tab.setAttribute('aria-pressed', view === state.view);
    const count = state.strokes[view]?.length ?? 0;
    tab.querySelector('.view-count').textContent = count === 0 ? 'no paint' : `${count} stroke${count === 1 ? '' : 's'}`;
  });
}

function askThumb(view) {
  stale.add(view);
  if (isDue) return;
  isDue = true;
  requestAnimationFrame(() => {
    isDue = false;
    for (const each of stale) drawThumb(each);
    stale.clear();
  });
}

function drawThumb(view) {
  const source = canvasOf('after', view) ?? canvasOf('before', view);
  const thumb = strip.children[view]?.querySelector('canvas');
  if (!source || !thumb) return;
  const context = thumb.getContext('2d');
  context.save();
  context.setTransform(1, 0, 0, 1, 0, 0);
  context.imageSmoothingQuality = 'high';
  context.drawImage(source, 0, 0, thumb.width, thumb.height);
  context.restore();
}

function drawMap() {
  const source = state.showsLightMap && canvasOf('light_map', null);
  if (!source) return;
  if (map.width !== source.width || map.height !== source.height) {
    map.width = source.width;
    map.height = source.height;
  }
  map.getContext('2d').drawImage(source, 0, 0);
}

function showActive() {
  strip.children[state.view]?.scrollIntoView({ block: 'nearest', inline: 'nearest' });
}

export function watchViews() {
  listen('scene', makeTabs);
  listen('view strokes', showTabs);
  listen('view', showActive);
  listen('picture', ({ kind, view }) => {
    if (kind === 'light_map') drawMap();
    else if (kind === 'after' || kind === 'before') askThumb(view);
  });
  listen('seeing', () => {
    if (!panel.hidden) drawMap();
  });
}
