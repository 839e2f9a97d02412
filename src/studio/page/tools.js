// Toolbar, switches and sliders: they show the state, and hand clicks on to the actions.

import { state, listen, tell, remember } from './state.js';
import {
  adjust, chooseTool, commands, commit, isOffered, largestRadius, paintInHand, see, selectedStroke, setStops, theme, toggle,
} from './actions.js';
import { byId, showFill } from './dom.js';
import { switchFree } from './free.js';
import { hardnessOf, opacityOf } from './strokes.js';

const SMALLEST_RADIUS = 0.5;

const all = (selector) => [...document.querySelectorAll(selector)];

const HINTS = {
  brush: 'Drag to paint. Shift draws straight, Alt picks a colour.',
  eraser: 'Drag to take paint away.',
  pick: 'Click to take the colour of the light there.',
  select: 'Click a stroke. Drag moves it, Delete removes it.',
};

// Sliders in steps, and what they stand for. Sizes grow by factors: small ones need finer steps.
const sliders = {
  radius: {
    toValue: (step) => SMALLEST_RADIUS * (largestRadius() / SMALLEST_RADIUS) ** (step / 1000),
    toStep: (value) => (1000 * Math.log(value / SMALLEST_RADIUS)) / Math.log(largestRadius() / SMALLEST_RADIUS),
    read: (paint) => paint.radius,
    text: (value) => `${(2 * value).toFixed(value < 5 ? 1 : 0)} px`,
  },
  hardness: percent(hardnessOf),
  opacity: percent(opacityOf),
};

function percent(read) {
  return { toValue: (step) => step / 100, toStep: (value) => value * 100, read, text: (value) => `${Math.round(value * 100)} %` };
}

function showSliders() {
  if (!state.scene) return;
  const paint = paintInHand();
  for (const [name, { toStep, read, text }] of Object.entries(sliders)) {
    const input = byId(name);
    const value = read(paint);
    input.value = toStep(value);
    input.setAttribute('aria-valuetext', text(value));
    byId(`${name}-value`).textContent = text(value);
    showFill(input);
  }
}

function watchSliders() {
  for (const [name, { toValue }] of Object.entries(sliders)) {
    const input = byId(name);
    input.addEventListener('input', () => {
      const value = toValue(Number(input.value));
      adjust({ [name]: Math.round(value * 100) / 100 });
    });
    input.addEventListener('change', commit);
  }
  const exposure = byId('exposure');
  exposure.addEventListener('input', () => setStops(Number(exposure.value)));
  exposure.addEventListener('dblclick', () => setStops(0));
}

function showExposure() {
  const input = byId('exposure');
  const sign = state.stops > 0 ? '+' : '';
  const text = `${sign}${state.stops.toFixed(1).replace('-', '−')} stops`;
  input.value = state.stops;
  input.setAttribute('aria-valuetext', text);
  byId('exposure-value').textContent = text;
  showFill(input);
}

function showTool() {
  for (const button of all('[data-tool]')) button.setAttribute('aria-pressed', button.dataset.tool === state.tool);
  showToolHint();
  showPanelTitle();
}

function showToolHint() {
  byId('tool-hint').textContent = state.free ? '' : state.asks?.hint ?? HINTS[state.tool];
}

const selectionTitle = ({ view, number }) => `Stroke ${number + 1} of ${state.views[view].name}`;

function showPanelTitle() {
  const isSelected = selectedStroke() !== null;
  const titles = { eraser: 'Eraser', select: 'Brush', brush: 'Brush', pick: 'Brush' };
  byId('panel-title').textContent = isSelected ? selectionTitle(state.selection) : titles[state.tool];
  byId('delete-stroke').disabled = !isSelected;
  byId('delete-stroke').classList.toggle('is-away', !isSelected);
}

// While the camera is free nothing is painted, and there is one picture only.
function showFree() {
  const isFree = state.free !== null;
  byId('segments').inert = isFree;
  for (const button of all('[data-tool], .rail [data-toggle]:not([data-toggle=showsLightMap])')) button.disabled = isFree;
  byId('camera').setAttribute('aria-pressed', isFree);
  byId('camera').disabled = !isFree && (state.socket !== 'open' || !state.views[state.view]?.camera);
  byId('zoom').disabled = isFree;
  showToolHint();
  showSteps();
  showHint();
}

function showSeeing() {
  for (const button of all('[data-seen]')) {
    const kind = state.peeks ? 'before' : state.seen;
    button.setAttribute('aria-pressed', button.dataset.seen === kind);
  }
  for (const button of all('.rail [data-toggle]')) {
    button.setAttribute('aria-pressed', state[button.dataset.toggle]);
    button.hidden = !isOffered(button.dataset.toggle);
  }
  byId('light-map').hidden = !state.showsLightMap;
}

function showSteps() {
  const isOpen = state.socket === 'open';
  byId('undo').disabled = !isOpen || !state.canUndo;
  byId('redo').disabled = !isOpen || !state.canRedo;
  byId('save').disabled = !isOpen;
  byId('export').disabled = !isOpen || state.isExporting;
  byId('clear').disabled = !isOpen || state.free !== null || !state.strokes[state.view]?.length;
  const isNew = state.scene?.is_new === true;
  const isSaved = state.isSaved && !isNew;
  const name = state.scene?.scene ?? 'unscatter';
  byId('scene-name').textContent = name;
  byId('scene-name').title = state.scene?.path ?? '';
  byId('unsaved').hidden = isSaved;
  byId('new-scene').hidden = !isNew;
  byId('save').dataset.tip = isNew ? 'Make the scene file  Ctrl S' : 'Write strokes into the scene file  Ctrl S';
  document.title = `${isSaved ? '' : '● '}${name}${isNew ? ' (not saved yet)' : ''} – unscatter`;
}

function showHint() {
  const isEmpty = state.scene && state.strokes.every((strokes) => strokes.length === 0) && state.pending.length === 0;
  byId('hint').hidden = !isEmpty || state.live !== null || state.free !== null;
  const file = state.scene?.path?.split(/[/\\]/).at(-1);
  byId('hint-what').textContent = state.scene?.is_volume
    ? 'Choose a colour and paint on the volume. It follows when you lift the pen.'
    : 'Choose a colour and paint on a light shaft: the slide in front of the sun is coloured so that it looks like that. White asks for the light as it is.';
  byId('hint-save').textContent = state.scene?.is_new ? ` Save makes the scene file ${file}.` : '';
}

function showPen() {
  byId('pen-box').hidden = !state.penSeen;
  byId('pen-pressure').checked = state.penPressure;
}

// Which sections of the panel are closed is remembered.
function watchSections() {
  for (const section of all('.panel details')) {
    section.open = !state.closed.includes(section.id);
    section.addEventListener('toggle', () => {
      state.closed = all('.panel details:not([open])').map(({ id }) => id);
      remember();
    });
  }
}

function showTheme() {
  document.documentElement.dataset.theme = theme();
}

export function watchTools() {
  for (const button of all('[data-tool]')) button.addEventListener('click', () => chooseTool(button.dataset.tool));
  for (const button of all('[data-seen]')) button.addEventListener('click', () => see(button.dataset.seen));
  for (const button of all('[data-toggle]')) button.addEventListener('click', () => toggle(button.dataset.toggle));
  for (const button of all('[data-command]')) button.addEventListener('click', () => commands[button.dataset.command]());
  byId('camera').addEventListener('click', switchFree);
  // After the mouse, keys belong to the picture again; who comes by keyboard stays where they are.
  for (const region of all('.top, .rail, .panel, .views, .status, .free-bar')) {
    region.addEventListener('pointerup', ({ target }) => {
      if (target.closest('button, input[type=range], canvas, summary, .switch')) {
        byId('view-canvas').focus({ preventScroll: true });
      }
    });
  }
  document.querySelector('.panel').addEventListener('change', ({ target }) => {
    if (target.matches('select') && !document.body.classList.contains('by-keys')) byId('view-canvas').focus({ preventScroll: true });
  });
  watchSliders();
  watchSections();
  byId('pen-pressure').addEventListener('change', ({ target }) => {
    state.penPressure = target.checked;
    remember();
  });
  matchMedia('(prefers-color-scheme: light)').addEventListener('change', () => tell('theme'));
  listen('brush selection scene', showSliders);
  listen('tool', showTool);
  listen('asks', showToolHint);
  listen('selection', showPanelTitle);
  listen('seeing scene', showSeeing);
  listen('seeing scene socket view', showFree);
  listen('pen', showPen);
  listen('exposure', showExposure);
  listen('scene strokes socket exporting view', showSteps);
  listen('scene strokes live marks', showHint);
  listen('theme', showTheme);
  for (const show of [showSliders, showTool, showSeeing, showExposure, showFree, showTheme, showPen]) show();
}
