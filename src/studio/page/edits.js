// Edits of what casts shadows in the air: their list in the panel, and the controls of each.

import { state, listen } from './state.js';
import { send } from './socket.js';
import { askView, beginDrag, change, drag, stopAsking } from './looks.js';
import { box, choice, keeper, linear, logarithmic, note, percent, push, row, slider, toggle } from './controls.js';
import { byId, element } from './dom.js';

const MOST_OCTAVES = 8;

const show = keeper(byId('edits'));
let open = -1; // the number of the edit whose controls are shown

const edits = () => state.looks?.looks.occluders ?? [];
const kindOf = (edit) => Object.keys(edit)[0];
const bodyOf = (edit) => edit[kindOf(edit)];

const nameOfView = () => state.views[state.view].name;
const span = () => state.look.span / state.looks.metres_per_unit;
const unit = () => (state.looks.metres_per_unit === 1 ? ' m' : '');
const short = (value) => Number(value.toPrecision(2));

// The edit with that number, and how its members are read and written.
function memberOf(number) {
  const now = () => bodyOf(edits()[number] ?? { none: {} });
  const write = (run, make) => run((looks) => make(bodyOf(looks.occluders[number])));
  return {
    now,
    read: (name, otherwise) => () => now()[name] ?? otherwise,
    drags: (name) => (value) => write(drag, (body) => {
      body[name] = value;
    }),
    changes: (make) => write(change, make),
  };
}

const strength = ({ read, drags }) => slider({
  label: 'Strength',
  title: 'How far shadows go from what they were to what the edit makes of them',
  scale: linear(0, 1),
  digits: 2,
  read: read('strength', 1),
  write: drags('strength'),
  begin: beginDrag,
  text: percent,
});

// In texels of the shadow map, or in units of the scene where the scene says so.
function reach(member, title) {
  const isLength = 'length' in member.now();
  return slider({
    label: 'Reach',
    title,
    scale: isLength ? logarithmic(span() / 2000, span() / 4) : logarithmic(1, state.looks.texels / 4),
    digits: 2,
    read: member.read(isLength ? 'length' : 'texels', 1),
    write: member.drags(isLength ? 'length' : 'texels'),
    begin: beginDrag,
    text: (value) => `${short(value)}${isLength ? unit() : ' texels'}`,
  });
}

const towards = (label, member) => choice({
  label,
  options: state.views.map(({ name }) => [name, name]),
  read: member.read('view', ''),
  write: (view) => member.changes((body) => {
    body.view = view;
  }),
});

const KERNELS = [['disc', 'Round'], ['square', 'Square'], ['lines', 'From a view']];

const kernel = (member) => choice({
  label: 'Shape',
  title: 'Round and square holes are filled as the sun sees them; from a view, what fills them hides behind what the view sees',
  options: KERNELS,
  read: member.read('kernel', 'disc'),
  write: (value) => member.changes((body) => {
    body.kernel = value;
    if (value === 'lines') body.view ??= nameOfView();
    else delete body.view;
  }),
});

const KINDS = {
  fill: {
    name: 'Fill holes',
    add: 'Fill',
    title: 'Closes narrow holes, and their shafts go out',
    make: () => ({ texels: short(Math.max(2, state.looks.texels / 100)) }),
    read: (body) => lengthText(body),
    parts: (member) => [
      kernel(member),
      ...(member.now().kernel === 'lines' ? [towards('View', member)] : []),
      reach(member, 'Holes up to twice as wide are filled'),
      strength(member),
    ],
  },
  extrude: {
    name: 'Deepen',
    add: 'Deepen',
    title: 'Makes what casts shadows deeper, away from a view: shafts begin later and have sharper rims',
    make: () => ({ view: nameOfView(), texels: short(Math.max(2, state.looks.texels / 100)) }),
    read: (body) => `from ${body.view}`,
    parts: (member) => [towards('View', member), reach(member, 'How much deeper'), strength(member)],
  },
  pierce: {
    name: 'Pierce',
    add: 'Pierce',
    title: 'Makes holes, and shafts come through them',
    make: () => ({ size: short(span() / 12), share: 0.4 }),
    read: ({ share = 0.5 }) => `${percent(share)} holes`,
    parts: holes,
  },
};

function lengthText({ texels, length }) {
  if (length !== undefined) return `${short(length)}${unit()}`;
  return texels === undefined ? '' : `${short(texels)} texels`;
}

function holes(member) {
  const at = (name, otherwise, rest) => slider({ digits: 2, read: member.read(name, otherwise), write: member.drags(name), begin: beginDrag, ...rest });
  const sway = () => member.now().sway;
  const swaying = (name, otherwise, rest) => slider({
    read: () => sway()?.[name] ?? otherwise,
    write: (value) => member.drags('sway')({ ...sway(), [name]: value }),
    begin: beginDrag,
    ...rest,
  });
  return [
    at('size', 1, { label: 'Size', title: 'About how far it is from hole to hole', scale: logarithmic(span() / 500, span() / 2), text: (value) => `${short(value)}${unit()}` }),
    at('share', 0.5, { label: 'Holes', title: 'The share of the area that becomes holes', scale: linear(0, 1), text: percent }),
    at('octaves', 5, {
      label: 'Rough rims', title: 'How many finer patterns rims have', scale: rounded(linear(1, MOST_OCTAVES)), text: String,
    }),
    strength(member),
    push({ label: 'Other holes', title: 'The same with holes in other places', run: () => member.changes((body) => {
      body.seed = (body.seed ?? 0) + 1;
    }) }),
    toggle({ label: 'Sway', title: 'Moves holes about, as leaves move', read: () => sway() !== undefined, write: (isOn) => member.changes((body) => {
      if (isOn) body.sway = { turn: 45 };
      else delete body.sway;
    }) }),
    ...(sway() === undefined ? [] : [
      swaying('turn', 0, { label: 'Time of the sway', title: 'Once around, holes are where they were', scale: linear(0, 360), text: (value) => `${Math.round(value)}°` }),
      swaying('amount', 0.5, { label: 'Width of the sway', title: 'In sizes of holes', scale: linear(0, 2), digits: 2, text: percent }),
    ]),
    pierced(member),
  ];
}

const rounded = ({ toStep, toValue }) => ({ toStep, toValue: (step) => Math.round(toValue(step)) });

// What is pierced: names that the scene has, and shapes without a name by their numbers.
function pierced(member) {
  const { objects = [], materials = [] } = state.looks.names;
  const has = (list, name) => (member.now()[list] ?? []).includes(name);
  const put = (list, name, isIn) => member.changes((body) => {
    const others = (body[list] ?? []).filter((each) => each !== name);
    body[list] = isIn ? [...others, name] : others;
    if (body[list].length === 0) delete body[list];
  });
  const tick = (list, name, text) => {
    const label = element('label', 'tick');
    const input = Object.assign(element('input'), { type: 'checkbox' });
    input.dataset.key = `${list} ${name}`;
    input.addEventListener('change', () => put(list, name, input.checked));
    label.append(input, element('span', '', text));
    label.title = text;
    return { nodes: [label], show: () => {
      input.checked = has(list, name);
    } };
  };
  const ticks = [
    ...objects.map((name) => tick('objects', name, name)),
    ...materials.map((name) => tick('materials', name, `${name} (material)`)),
    ...(member.now().occluders ?? []).map((number) => tick('occluders', number, `Shape ${number}`)),
  ];
  const isAll = () => ['objects', 'materials', 'occluders'].every((list) => !member.now()[list]?.length);
  const what = element('p', 'quiet');
  const words = { nodes: [what], show: () => {
    what.textContent = isAll() ? 'All that casts shadows is pierced.' : 'Only what is ticked is pierced.';
  } };
  const hint = 'Click in the picture on what is to be pierced. Esc ends it.';
  const asksView = push({
    label: 'Choose in the picture',
    title: 'A click on something pierces only that, and what else is ticked',
    isPressed: () => state.asks?.hint === hint,
    run: () => (state.asks?.hint === hint ? stopAsking() : askView({
      hint,
      begin: (view, [x, y]) => send({ type: 'what', view, x, y }),
      answer: ({ object, occluder }) => {
        if (object === null && occluder === null) return;
        if (object !== null) put('objects', object, !has('objects', object));
        else put('occluders', occluder, !has('occluders', occluder));
      },
    })),
  });
  return box('pierced', [words, ...(ticks.length > 0 ? [box('ticks', ticks)] : []), asksView]);
}

// What decides which controls there are.
function structureOf(edit, number) {
  const { kernel: shape, length, sway, occluders } = bodyOf(edit) ?? {};
  const isOpen = number === open;
  return [kindOf(edit), isOpen, ...(isOpen ? [shape, length !== undefined, sway !== undefined, occluders] : [])];
}

function showEdits() {
  if (!state.looks) return;
  const all = edits();
  const names = [state.views.map(({ name }) => name), state.looks.names, state.looks.texels, state.looks.metres_per_unit];
  show([all.map(structureOf), ...names, state.look.span], () => all.map((edit, number) => rowOf(edit, number, all.length)));
}

function rowOf(edit, number, count) {
  const { name, title, read, parts } = KINDS[kindOf(edit)] ?? {
    name: kindOf(edit), title: '', read: () => '', parts: () => [note("The scene's text says what this is. It stays as it is.")],
  };
  const member = memberOf(number);
  return row({
    kind: 'edit',
    number,
    count,
    upward: -1,
    name,
    title,
    read: () => read(member.now()),
    isOpen: number === open,
    open: () => choose(number === open ? -1 : number),
    move: (step) => {
      if (open === number || open === number + step) open = open === number ? number + step : number;
      change(({ occluders }) => occluders.splice(number + step, 0, ...occluders.splice(number, 1)));
    },
    remove: () => {
      open = open > number ? open - 1 : open === number ? -1 : open;
      stopAsking();
      change((looks) => {
        looks.occluders.splice(number, 1);
        if (looks.occluders.length === 0) delete looks.occluders;
      });
    },
    parts: () => parts(member),
  });
}

function choose(number) {
  open = number;
  stopAsking();
  showEdits();
}

function add(kind) {
  if (!state.looks) return;
  open = edits().length;
  change((looks) => {
    looks.occluders = [...(looks.occluders ?? []), { [kind]: KINDS[kind].make() }];
  });
}

export function watchEdits() {
  const buttons = Object.entries(KINDS).map(([kind, { add: label, title }]) => push({ label, title, run: () => add(kind) }));
  byId('add-edits').append(...buttons.flatMap(({ nodes }) => nodes));
  listen('looks look scene asks', showEdits);
  listen('part', (told) => state.asks?.answer?.(told));
}
