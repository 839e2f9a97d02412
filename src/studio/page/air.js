// Irregular air: its noise, and what is painted in it, on a plane across the view.

import { state, listen, tell } from './state.js';
import { askView, beginDrag, change, drag, stopAsking } from './looks.js';
import { choice, keeper, linear, logarithmic, percent, push, slider, toggle } from './controls.js';
import { addPoint, rounded } from './strokes.js';
import { depthAt, veilOf } from './plane.js';
import { byId, element } from './dom.js';

const VOLUMES = {
  amount: { name: 'How uneven', base: 1, most: 1, paints: 0, text: percent },
  frequency: { name: 'How smooth', base: 0, most: 6, paints: 2, text: (value) => `${value.toFixed(1)} levels` },
  intensity: { name: 'How bright', base: 1, most: 4, paints: 2, text: percent },
};
const MOST_OCTAVES = 5; // what the noise has room for, with its four cells

const isOn = byId('air-on');
const showSliders = keeper(byId('air-sliders'));
const brush = { volume: 'amount', value: 0, distance: 0, radius: 0, depth: 1, hardness: 0.5, opacity: 1, erase: false };
let switchedOff = null; // what there was before
let path = null; // { view, stroke }: the stroke under way

const air = () => state.looks?.looks.heterogeneity;
const units = (metres) => metres / state.looks.metres_per_unit;
const span = () => units(state.look.span);
const short = (value) => Number(value.toPrecision(2));
const length = (value) => `${short(value)}${state.looks.metres_per_unit === 1 ? ' m' : ''}`;
const whole = ({ toStep, toValue }) => ({ toStep, toValue: (step) => Math.round(toValue(step)) });

const strokesOf = (volume) => air()?.[volume]?.strokes ?? [];

// Members of an object in the heterogeneity of the scene, such as of its noise.
function memberSlider(part, name, otherwise, rest) {
  return slider({
    digits: 2,
    read: () => air()?.[part]?.[name] ?? otherwise(),
    write: (value) => drag(({ heterogeneity }) => {
      heterogeneity[part] = { ...heterogeneity[part], [name]: value };
    }),
    begin: beginDrag,
    ...rest,
  });
}

// What is in hand, which no scene has.
const handSlider = (name, rest) => slider({
  digits: 2,
  read: () => brush[name],
  write: (value) => {
    brush[name] = value;
    tell('air');
  },
  begin: () => {},
  ...rest,
});

// How many pixels of the picture of a view a length is on the plane.
function pixelsOf(view, size) {
  const { camera: { fov }, size: [, height] } = state.views[view];
  return (size / brush.distance) * (height / 2) / Math.tan((fov * Math.PI) / 360);
}

const HINT = 'Paint in the air, on the plane. Alt and the wheel slide it, Esc ends it.';
const PLACE_HINT = 'Click on a surface: the plane goes there. Esc ends it.';

const asking = {
  hint: HINT,
  ring: (view) => ({ radius: pixelsOf(view, brush.radius), hardness: brush.hardness }),
  veil: (view) => veilOf(view, brush.distance),
  path: (view) => (path?.view === view ? path.stroke : null),
  begin: (view, point) => {
    const color = brush.erase ? '#b0b0b0' : '#ffffff';
    const { hardness } = brush;
    path = { view, stroke: { points: [point.map(rounded)], radius: pixelsOf(view, brush.radius), hardness, opacity: 0.35, color } };
    tell('live');
  },
  move: (_, point) => {
    if (!path) return;
    addPoint(path.stroke, point);
    tell('live');
  },
  end: () => {
    if (!path) return;
    const { view, stroke } = path;
    path = null;
    const { volume, value, distance, radius, depth, hardness, opacity, erase } = brush;
    change(({ heterogeneity }) => {
      const blend = { ...heterogeneity[volume] };
      blend.strokes = [...(blend.strokes ?? []), {
        ...(erase ? { erase: true } : { value }),
        view: state.views[view].name,
        distance,
        pixels: stroke.points.map((each) => each.map(rounded)),
        radius,
        ...(depth === 1 ? {} : { depth: Number((depth * radius).toPrecision(3)) }),
        opacity,
        hardness,
      }];
      heterogeneity[volume] = blend;
    });
    tell('live');
  },
  slide: (steps) => {
    brush.distance = Number((brush.distance * 1.06 ** steps).toPrecision(3));
    tell('air');
  },
};

const placing = {
  hint: PLACE_HINT,
  veil: asking.veil,
  begin: (view, point) => {
    const depth = depthAt(view, point);
    if (depth !== null) brush.distance = Number(depth.toPrecision(3));
    askView(asking);
    tell('air');
  },
};

const asks = (what) => push({
  label: what === asking ? 'Paint in the air' : 'Plane to a surface',
  title: what === asking ? 'The next strokes in the picture are in the air, on the plane' : 'The next click in the picture puts the plane where a surface is',
  isPressed: () => state.asks === what,
  run: () => (state.asks === what ? stopAsking() : askView(what)),
});

function controls() {
  const { name, most, text } = VOLUMES[brush.volume];
  const has = strokesOf(brush.volume).length > 0;
  const words = element('p', 'quiet');
  return [
    memberSlider('noise', 'size', () => units(state.looks.air_size ?? state.look.span), {
      label: 'Size of clouds', title: 'The side of a cube of noise; it is repeated in all directions', scale: logarithmic(span() / 50, 4 * span()), text: length,
    }),
    memberSlider('noise', 'octaves', () => 4, { label: 'Fine detail', title: 'How many finer patterns there are', scale: whole(linear(1, MOST_OCTAVES)), text: String }),
    memberSlider('amount', 'base', () => 1, { label: 'Unevenness', title: 'How uneven the air is where nothing is painted', scale: linear(0, 1), text: percent }),
    memberSlider('intensity', 'base', () => 1, { label: 'Brightness', title: 'How much light the air scatters where nothing is painted', scale: linear(0, 4), text: percent }),
    push({ label: 'Other clouds', title: 'The same with clouds in other places', run: () => change(({ heterogeneity }) => {
      heterogeneity.noise = { ...heterogeneity.noise, seed: (heterogeneity.noise?.seed ?? 0) + 1 };
    }) }),
    choice({ label: 'Paint', title: 'What strokes in the air are about', options: Object.entries(VOLUMES).map(([key, volume]) => [key, volume.name]), read: () => brush.volume, write: (volume) => {
      brush.volume = volume;
      brush.value = VOLUMES[volume].paints;
      tell('air');
    } }),
    toggle({ label: 'Eraser', title: 'Strokes take away what has been painted', read: () => brush.erase, write: (erase) => {
      brush.erase = erase;
      tell('air');
    } }),
    ...(brush.erase ? [] : [handSlider('value', { label: name, title: 'What is painted', scale: linear(0, most), text })]),
    handSlider('distance', { label: 'Plane', title: 'How far away, straight ahead (Alt and the wheel)', scale: logarithmic(span() / 200, 8 * span()), digits: 3, text: length }),
    handSlider('radius', { label: 'Size of the brush', title: 'Its radius on the plane', scale: logarithmic(Math.max(units(state.looks.air_voxel ?? 0), span() / 500), span()), text: length }),
    handSlider('depth', { label: 'Depth of the brush', title: 'Along the view, as a share of its radius', scale: logarithmic(0.1, 10), text: percent }),
    handSlider('hardness', { label: 'Hardness', title: 'The part of the brush that is whole', scale: linear(0, 1), text: percent }),
    handSlider('opacity', { label: 'Opacity', title: 'How far values go towards what is painted', scale: linear(0.01, 1), text: percent }),
    asks(asking),
    asks(placing),
    { nodes: [words], show: () => {
      const count = strokesOf(brush.volume).length;
      words.textContent = count === 0 ? 'Nothing of this is painted.' : `${count} stroke${count === 1 ? '' : 's'} of this.`;
    } },
    ...(has ? [
      push({ label: 'Remove the last', title: 'The last stroke of this', run: () => change(({ heterogeneity }) => keepStrokes(heterogeneity, -1)) }),
      push({ label: 'Remove all', title: 'All strokes of this', run: () => change(({ heterogeneity }) => keepStrokes(heterogeneity, 0)) }),
    ] : []),
  ];
}

// The strokes before that one stay.
function keepStrokes(heterogeneity, end) {
  const blend = heterogeneity[brush.volume];
  blend.strokes = blend.strokes.slice(0, end);
  if (blend.strokes.length === 0) delete blend.strokes;
  if (Object.keys(blend).length === 0) delete heterogeneity[brush.volume];
}

function show() {
  if (!state.looks) return;
  isOn.checked = air() !== undefined;
  byId('air-box').hidden = air() === undefined;
  if (air() === undefined) {
    if (state.asks === asking || state.asks === placing) stopAsking();
    return;
  }
  brush.distance ||= Number((0.5 * span()).toPrecision(2));
  brush.radius ||= Number((span() / 12).toPrecision(2));
  const structure = [state.look.span, state.looks.metres_per_unit, state.looks.air_voxel, brush.volume, brush.erase, strokesOf(brush.volume).length > 0];
  showSliders(structure, controls);
  tell('marks');
}

function switchTo(on) {
  if (!on) switchedOff = air();
  change((looks) => {
    if (on) looks.heterogeneity = switchedOff ?? {};
    else delete looks.heterogeneity;
  });
}

export function watchAir() {
  isOn.addEventListener('change', () => switchTo(isOn.checked));
  listen('looks look asks air', show);
  listen('picture', ({ kind }) => kind === 'depth' && tell('marks'));
}
