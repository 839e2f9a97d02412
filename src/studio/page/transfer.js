// The transfer function: its sliders, its layers of colour, and the points that colour spreads from.

import { state, listen, tell } from './state.js';
import { askView, beginDrag, change, drag, stopAsking } from './looks.js';
import { choice, keeper, linear, logarithmic, note, percent, push, row, slider, spot } from './controls.js';
import { axesOf, isDrawn, layersOf, pointsOf, WORDS } from './points.js';
import { cssColor } from './colour.js';
import { byId, element } from './dom.js';

const BLENDS = [['alpha', 'Over'], ['multiply', 'Multiply'], ['add', 'Add']];
const FIRST = { gradient: { along: 'depth', from: '#ffdca8', to: '#86a4ff' } }; // a layer that shows what this is about
const LONGEST = 256;
const ROLES = [['factor', 'A factor of the light'], ['color', 'The light itself']];
const MOST_COLOR = 0.9;
const SHADE = { along: 'visibility', from: '#000000', to: '#ffffff', blend: 'multiply' };

const showLayers = keeper(byId('layers'));
const showSliders = keeper(byId('transfer-sliders'));
const isOn = byId('transfer-on');
let open = -1; // the number of the layer whose controls are shown
let switchedOff = null; // what there was before

const transfer = () => state.looks?.looks.transfer;
const kindOf = (layer) => Object.keys(layer)[0];
const bodyOf = (layer) => layer?.[kindOf(layer)] ?? {};
const short = (value) => Number(value.toPrecision(2));
const units = (metres) => metres / state.looks.metres_per_unit;
const isMetres = () => state.looks.metres_per_unit === 1;

const bodyIn = (looks, layer) => bodyOf(looks.transfer.layers[layer]);

// The layer with that number, and how its members are read and written.
function memberOf(layer) {
  const now = () => bodyOf(layersOf()[layer]);
  return {
    now,
    read: (name, otherwise) => () => now()[name] ?? otherwise,
    drags: (name) => (value) => drag((looks) => {
      bodyIn(looks, layer)[name] = value;
    }),
    changes: (name) => (value) => change((looks) => {
      bodyIn(looks, layer)[name] = value;
    }),
  };
}

const spotOf = (label, member, name) => spot({
  label,
  read: () => cssColor(member.now()[name] ?? '#ffffff'),
  ask: (anchor) => tell('ask-color', {
    anchor, label, read: () => member.now()[name] ?? '#ffffff', take: member.drags(name), begin: beginDrag,
  }),
});

const share = (label, title, member, name) => slider({
  label, title, scale: linear(0, 1), digits: 2, read: member.read(name, 1), write: member.drags(name), begin: beginDrag, text: percent,
});

const KINDS = {
  solid: {
    name: 'One colour',
    add: 'Colour',
    title: 'The same colour everywhere',
    make: () => ({ color: state.brush.color }),
    sign: ({ color }) => cssColor(color),
    parts: (member) => [spotOf('Colour', member, 'color')],
  },
  gradient: {
    name: 'Gradient',
    add: 'Gradient',
    title: 'From one colour to another, by depth or by light',
    make: () => ({ along: axesOf()[1], from: '#ffffff', to: state.brush.color }),
    sign: ({ from, to }) => `linear-gradient(to right, ${cssColor(from)}, ${cssColor(to)})`,
    parts: (member) => {
      const { from, to } = WORDS[member.now().along] ?? WORDS.depth;
      return [
        choice({ label: 'By', options: axesOf().map((axis) => [axis, WORDS[axis]?.by ?? axis]), read: member.read('along'), write: member.changes('along') }),
        spotOf(capital(from), member, 'from'),
        spotOf(capital(to), member, 'to'),
      ];
    },
  },
  diffusion: {
    name: 'Points',
    add: 'Points',
    title: 'Colour that spreads from points, each of which keeps its own',
    make: () => ({ points: [{ color: state.brush.color, at: [0.5, 0.5] }] }),
    sign: ({ points }) => {
      const colors = points.slice(0, 6).map(({ color }) => cssColor(color));
      return `linear-gradient(to right, ${[...colors, colors.at(-1)].join(', ')})`;
    },
    parts: (member, layer) => pointParts(layer),
  },
  image: {
    name: 'Picture',
    add: 'Picture',
    title: 'A picture file: its axes are those of the table',
    sign: () => 'repeating-linear-gradient(45deg, #999 0 3px, #555 3px 6px)',
    parts: (member) => [note(member.now().file ?? '')],
  },
};

const capital = (word) => word[0].toUpperCase() + word.slice(1);

function pointParts(layer) {
  const number = state.point?.layer === layer ? state.point.number : -1;
  const now = () => pointsOf(layer)[number] ?? {};
  const drags = (name) => (value) => drag((looks) => {
    bodyIn(looks, layer).points[number][name] = value;
  });
  const hint = 'Click in the picture: a point for what is seen there, which may be dragged. Esc ends it.';
  const places = push({
    label: 'Place in the picture',
    title: 'The next click in the picture makes a point for what is seen there',
    isPressed: () => state.asks?.hint === hint,
    run: () => (state.asks?.hint === hint ? stopAsking() : askView(placing(layer, hint))),
  });
  if (number < 0) return [note(`${pointsOf(layer).length > 1 ? 'Click a point' : 'Click the point'} above to change it, or elsewhere to add one.`), places];
  const where = element('p', 'quiet');
  return [
    { nodes: [where], show: () => {
      where.textContent = placeText(number, now());
    } },
    spot({
      label: 'Colour of the point',
      read: () => cssColor(now().color ?? '#ffffff'),
      ask: (anchor) => tell('ask-color', {
        anchor, label: 'Colour of the point', read: () => now().color ?? '#ffffff', take: drags('color'), begin: beginDrag,
      }),
    }),
    slider({ label: 'Opacity of the point', scale: linear(0, 1), digits: 2, read: () => now().alpha ?? 1, write: drags('alpha'), begin: beginDrag, text: percent }),
    push({ label: 'Remove the point', title: 'Delete', run: removePoint }),
    places,
  ];
}

function placeText(number, { at, view, pixel }) {
  const name = `Point ${number + 1}`;
  if (pixel) return `${name}, what ${view} sees at ${pixel.map(Math.round).join(', ')}`;
  if (view) return `${name}, on a surface that ${view} sees`;
  const [across, down] = axesOf().map((axis) => WORDS[axis]?.short ?? axis);
  return at ? `${name}, ${across} ${percent(at[0])}, ${down} ${percent(at[1])}` : name;
}

// A press in the picture makes a point there, a drag moves it on.
function placing(layer, hint) {
  const put = (view, pixel) => drag((looks) => {
    const point = bodyIn(looks, layer).points[state.point.number];
    Object.assign(point, { view: state.views[view].name, pixel });
    delete point.at;
  });
  const within = (view, point) => point.map((value, axis) => Math.round(Math.min(state.views[view].size[axis], Math.max(0, value)) * 10) / 10);
  return {
    hint,
    begin: (view, point) => {
      addPoint({ color: state.brush.color, view: state.views[view].name, pixel: within(view, point) }, layer);
    },
    move: (view, point) => state.point && put(view, within(view, point)),
    end: stopAsking,
  };
}

// Into that layer, or else into the one that is open, or the uppermost one with points; where there is none, one is made.
export function addPoint(point, layer = layerForPoints()) {
  const isNew = layer < 0;
  const at = isNew ? layersOf().length : layer;
  beginDrag();
  // Before it is there: what hears of the change shows it.
  state.point = { layer: at, number: isNew ? 0 : pointsOf(at).length };
  open = at;
  drag(({ transfer: { layers } }) => {
    if (isNew) layers.push({ diffusion: { points: [point], ...blendOfNew() } });
    else bodyOf(layers[at]).points.push(point);
  });
}

function layerForPoints() {
  const hasPoints = (layer) => layer !== undefined && 'diffusion' in layer;
  return hasPoints(layersOf()[open]) ? open : layersOf().findLastIndex(hasPoints);
}

// A new layer would hide those below it.
const blendOfNew = () => (layersOf().length > 0 ? { blend: 'multiply' } : {});

// The last point takes its layer along: without points there is none.
export function removePoint() {
  if (!state.point) return;
  const { layer, number } = state.point;
  state.point = null;
  stopAsking();
  if (pointsOf(layer).length === 1) removeLayer(layer);
  else {
    change((looks) => {
      bodyIn(looks, layer).points.splice(number, 1);
    });
  }
}

export function openLayer(layer) {
  open = layer;
  show();
}

function removeLayer(layer) {
  if (layersOf().length === 1) {
    switchOff();
    return;
  }
  open = open > layer ? open - 1 : open === layer ? -1 : open;
  state.point = null;
  stopAsking();
  change((looks) => looks.transfer.layers.splice(layer, 1));
}

function moveLayer(layer, step) {
  const other = layer + step;
  const swapped = (number) => (number === layer ? other : number === other ? layer : number);
  open = swapped(open);
  if (state.point) state.point = { ...state.point, layer: swapped(state.point.layer) };
  change((looks) => looks.transfer.layers.splice(other, 0, ...looks.transfer.layers.splice(layer, 1)));
}

function addLayer(kind, body) {
  open = layersOf().length;
  state.point = kind === 'diffusion' ? { layer: open, number: 0 } : null;
  change((looks) => looks.transfer.layers.push({ [kind]: { ...body, ...blendOfNew() } }));
}

// The name of a file, asked for where the button was.
function askFile(button) {
  const field = Object.assign(element('input', 'field'), { type: 'text', maxLength: LONGEST, spellcheck: false, placeholder: 'colours.png' });
  field.setAttribute('aria-label', 'Name of a PNG or EXR file beside the scene');
  field.title = 'A PNG or EXR file, beside the scene. Enter takes it.';
  const row = byId('add-layers');
  let isLeft = false;
  const leave = (takes) => {
    if (isLeft) return;
    isLeft = true;
    field.replaceWith(button);
    row.classList.remove('is-asked');
    if (takes && field.value.trim()) addLayer('image', { file: field.value.trim() });
  };
  field.addEventListener('keydown', (event) => {
    event.stopPropagation();
    if (event.key === 'Enter' || event.key === 'Escape') leave(event.key === 'Enter');
  });
  field.addEventListener('blur', () => leave(false));
  button.replaceWith(field);
  row.classList.add('is-asked');
  field.focus();
}

function rowOf(layer, number, count) {
  const { name, title, sign, parts } = KINDS[kindOf(layer)] ?? {
    name: kindOf(layer), title: '', parts: () => [note("The scene's text says what this is. It stays as it is.")],
  };
  const member = memberOf(number);
  return row({
    kind: 'layer',
    number,
    count,
    // The topmost is the first in the list, and the last in the scene.
    upward: 1,
    name,
    title,
    read: () => [BLENDS.find(([blend]) => blend === member.now().blend && blend !== 'alpha')?.[1], (member.now().opacity ?? 1) < 1 && percent(member.now().opacity)]
      .filter(Boolean).join(' '),
    isOpen: number === open,
    open: () => {
      stopAsking();
      if (state.point && state.point.layer !== number) state.point = null;
      openLayer(number === open ? -1 : number);
    },
    move: (step) => moveLayer(number, step),
    remove: () => removeLayer(number),
    sign: sign && ((head) => {
      const swatch = element('span', 'sign');
      head.prepend(swatch);
      return () => {
        swatch.style.background = sign(member.now());
      };
    }),
    parts: () => [
      ...parts(member, number),
      choice({ label: 'Blend', title: 'How it lies on the layers below', options: BLENDS, read: member.read('blend', 'alpha'), write: member.changes('blend') }),
      share('Opacity', 'How much of it is laid on the layers below', member, 'opacity'),
    ],
  });
}

// What decides which controls there are.
function structureOf(layer, number) {
  const inHand = state.point?.layer === number ? state.point.number : -1;
  const { along, points, file } = bodyOf(layer);
  return [kindOf(layer), number === open, ...(number === open ? [along, points?.length > 1, file, inHand] : [])];
}

function sliders() {
  const farText = (value) => `${short(value)}${isMetres() ? ' m' : ''}${'far' in transfer() ? '' : ' (as seen)'}`;
  const far = () => transfer().far ?? units(state.looks.far ?? state.look.span);
  const longest = () => 20 * units(state.look.span);
  return [
    choice({
      label: 'Colours are', title: 'What the table gives a line of sight', options: ROLES, read: () => transfer().as ?? 'factor',
      write: (role) => change((looks) => {
        looks.transfer.as = role;
        if (role !== 'color') return;
        // A light map has something to change where some of the light is left.
        looks.transfer.strength = Math.min(looks.transfer.strength ?? 1, MOST_COLOR);
        // What no light reaches would glow.
        const { layers } = looks.transfer;
        const knowsShade = layers.some(({ solid, gradient }) => !solid && (!gradient || gradient.along === 'visibility'));
        if (!knowsShade && axesOf().includes('visibility')) layers.push({ gradient: SHADE });
      }),
    }),
    ...['Across', 'Down'].map((label, axis) => choice({
      label, title: 'What a line of sight is looked up by', options: Object.entries(WORDS).map(([name, { by }]) => [name, by]), read: () => axesOf()[axis],
      write: (name) => turnAxis(axis, name),
    })),
    slider({
      label: 'Far end', title: 'How deep a line of sight is at the lower end of the table', scale: logarithmic(longest() / 2000, longest()), digits: 2,
      read: far, write: (value) => drag((looks) => {
        looks.transfer.far = value;
      }), begin: beginDrag, text: farText,
    }),
    slider({
      label: 'Strength', title: 'How far colours go from none to these', scale: linear(0, 1), digits: 2, read: () => transfer().strength ?? 1,
      write: (value) => drag((looks) => {
        looks.transfer.strength = value;
      }), begin: beginDrag, text: percent,
    }),
  ];
}

// Gradients go along with the axis that they were along. Both axes are never the same: the other one becomes what this one was.
function turnAxis(axis, name) {
  const before = axesOf();
  const axes = before.map((other, number) => (number === axis ? name : other === name ? before[axis] : other));
  change(({ transfer: function_ }) => {
    for (const { gradient } of function_.layers) {
      if (gradient && !axes.includes(gradient.along)) gradient.along = name;
    }
    function_.axes = axes;
  });
}

function show() {
  if (!state.looks) return;
  isOn.checked = transfer() !== undefined;
  byId('transfer-name').textContent = `Colour by ${axesOf().map((axis) => WORDS[axis]?.short ?? axis).join(' and ')}`;
  const isKnown = isDrawn();
  byId('transfer-other').hidden = transfer() === undefined || isKnown;
  byId('transfer-box').hidden = !isKnown;
  if (!isKnown) return;
  if (state.point && !pointsOf(state.point.layer)[state.point.number]) state.point = null;
  if (!layersOf()[open]) open = -1;
  showSliders([state.look.span, state.looks.metres_per_unit], sliders);
  const layers = layersOf();
  showLayers([layers.map(structureOf), axesOf()], () => layers.map((layer, number) => rowOf(layer, number, layers.length)).reverse());
  tell('table');
}

function switchOff() {
  switchedOff = transfer();
  state.point = null;
  open = -1;
  stopAsking();
  change((looks) => {
    delete looks.transfer;
  });
}

// As it was when it was switched off, else something that shows what this is about.
function switchOn() {
  change((looks) => {
    looks.transfer = switchedOff ?? { layers: [FIRST] };
  });
}

export function watchTransfer() {
  isOn.addEventListener('change', () => (isOn.checked ? switchOn() : switchOff()));
  const buttons = Object.entries(KINDS).map(([kind, { add: label, title, make }]) => {
    const button = push({ label, title, run: () => (make ? addLayer(kind, make()) : askFile(button.nodes[0])) });
    return button;
  });
  byId('add-layers').append(...buttons.flatMap(({ nodes }) => nodes));
  listen('looks look asks', show);
  listen('removal', removePoint);
}
