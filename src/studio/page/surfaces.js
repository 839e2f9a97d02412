// Light from everywhere on surfaces: how it is kept from corners.

import { state, listen } from './state.js';
import { beginDrag, change, drag } from './looks.js';
import { choice, keeper, linear, logarithmic, note, slider } from './controls.js';
import { byId } from './dom.js';

const METHODS = [
  ['open', 'Everywhere alike'], ['ambient-occlusion', 'Ambient occlusion'], ['bent-normals', 'Bent normals'], ['bent-cones', 'Bent cones'], ['rays', 'Rays (slow)'],
];
const DEFAULT = 'bent-cones';
const SAMPLES = { rays: 256 };

const isOn = byId('surfaces-on');
const show = keeper(byId('surfaces-sliders'));
let switchedOff = null; // what there was before

const surfaces = () => state.looks?.looks.surfaces;
const method = () => surfaces()?.method ?? DEFAULT;
const span = () => state.look.span / state.looks.metres_per_unit;
const short = (value) => Number(value.toPrecision(2));
const rounded = ({ toStep, toValue }) => ({ toStep, toValue: (step) => Math.round(toValue(step)) });
const isScreen = () => !['open', 'rays'].includes(method());

const at = (name, otherwise, rest) => slider({
  digits: 2,
  read: () => surfaces()?.[name] ?? otherwise(),
  write: (value) => drag((looks) => {
    looks.surfaces[name] = value;
  }),
  begin: beginDrag,
  ...rest,
});

function controls() {
  const { file } = surfaces().environment ?? {};
  return [
    choice({ label: 'Shade', title: 'How it is found what hides the light', options: METHODS, read: method, write: (value) => change((looks) => {
      looks.surfaces.method = value;
    }) }),
    ...(isScreen() ? [at('radius', () => span() / 20, {
      label: 'Reach', title: 'How far what hides the light may be', scale: logarithmic(span() / 500, span()),
      text: (value) => `${short(value)}${state.looks.metres_per_unit === 1 ? ' m' : ''}${'radius' in (surfaces() ?? {}) ? '' : ' (as seen)'}`,
    })] : []),
    ...(method() === 'open' ? [] : [at('samples', () => SAMPLES[method()] ?? 8, {
      label: 'Samples', title: 'Directions that are asked at each pixel', scale: rounded(method() === 'rays' ? logarithmic(16, 1024) : linear(1, 64)), digits: 4, text: String,
    })]),
    note(file ? `Its light is that of ${file}.` : 'Its light is the same from everywhere, as the scene says. The text of the scene may name a picture of the sky (environment.file).'),
  ];
}

function showSurfaces() {
  if (!state.looks) return;
  isOn.checked = surfaces() !== undefined;
  byId('surfaces-box').hidden = surfaces() === undefined;
  if (surfaces() === undefined) return;
  show([state.look.span, state.looks.metres_per_unit, method(), surfaces().environment?.file], controls);
}

export function watchSurfaces() {
  isOn.addEventListener('change', () => {
    if (!isOn.checked) switchedOff = surfaces();
    change((looks) => {
      if (isOn.checked) looks.surfaces = switchedOff ?? {};
      else delete looks.surfaces;
    });
  });
  listen('looks look', showSurfaces);
}
