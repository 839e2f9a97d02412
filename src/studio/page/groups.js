// Groups of strokes: their list in the panel, the one that new strokes go into, and which strokes are hidden.

import { state, listen, tell } from './state.js';
import { commit, select, selectedStroke } from './actions.js';
import { isOpen, send } from './socket.js';
import { byId, element, icon, showFill } from './dom.js';

const LONGEST = 64;

const list = byId('groups');
const weight = byId('group-weight');

let listed = ''; // the names that the list was made of

export const isShown = (stroke) => !stroke.group || !groupOf(stroke.group)?.hidden;

const groupOf = (name) => state.groups.find((group) => group.name === name);

// The group in hand: that of the selected stroke, or else the one for new strokes.
const nameInHand = () => (selectedStroke() ? selectedStroke().group ?? null : state.group);

function change(groups) {
  if (!isOpen()) return;
  commit();
  send({ type: 'groups', groups });
  state.groups = groups.map(({ was, ...group }) => group);
  if (selectedStroke() && !isShown(selectedStroke())) select(null);
  dropGroup();
  tell('groups');
}

const changeOne = (name, part) => change(state.groups.map((group) => (group.name === name ? { ...group, ...part } : group)));

// Paint that cannot be seen would puzzle: no new stroke goes into a hidden group.
function dropGroup() {
  const group = groupOf(state.group);
  if (!group || group.hidden) state.group = null;
}

function choose(name) {
  const stroke = selectedStroke();
  if (stroke) {
    moveInto(stroke, name);
    return;
  }
  if (groupOf(name)?.hidden) changeOne(name, { hidden: false });
  state.group = name;
  tell('groups');
}

function moveInto(stroke, name) {
  if ((stroke.group ?? null) === name || !isOpen()) return;
  const { group, ...rest } = stroke;
  state.draft = { ...state.selection, stroke: name ? { ...rest, group: name } : rest };
  commit();
  if (groupOf(name)?.hidden) select(null);
  tell('groups');
}

function remove(name) {
  change(state.groups.filter((group) => group.name !== name));
  tell('notice', { kind: 'done', text: `The group ${name} is gone, its strokes stay. Undo brings it back.` });
}

function rename(was, name) {
  if (!isFree(name)) return;
  if (state.group === was) state.group = name;
  // Until the server says the same, the strokes go along.
  const follow = (stroke) => (stroke.group === was ? { ...stroke, group: name } : stroke);
  state.strokes = state.strokes.map((strokes) => strokes.map(follow));
  change(state.groups.map((group) => (group.name === was ? { ...group, name, was } : group)));
}

function add(name) {
  if (!isFree(name)) return;
  change([...state.groups, { name, hidden: false, weight: 1 }]);
  choose(name);
}

const isFree = (name) => name !== '' && !groupOf(name);

function nextName() {
  let number = state.groups.length + 1;
  while (groupOf(`group ${number}`)) number += 1;
  return `group ${number}`;
}

// A field in the place of a row: Enter or a click elsewhere takes the name, Escape leaves things as they were.
function askName(row, name, take) {
  const field = Object.assign(element('input', 'field'), { type: 'text', value: name, maxLength: LONGEST, spellcheck: false });
  field.setAttribute('aria-label', 'Name of the group');
  let isLeft = false;
  const leave = (takes) => {
    if (isLeft) return;
    isLeft = true;
    field.replaceWith(row);
    if (!row.dataset.name) row.remove();
    if (takes) take(field.value.trim());
  };
  field.addEventListener('keydown', (event) => {
    event.stopPropagation();
    if (event.key === 'Enter' || event.key === 'Escape') leave(event.key === 'Enter');
  });
  field.addEventListener('blur', () => leave(true));
  row.replaceWith(field);
  field.focus();
  field.select();
}

function askNew() {
  if (!isOpen()) return;
  byId('groups-section').open = true;
  const place = element('div');
  list.append(place);
  askName(place, nextName(), add);
}

function button(className, sign, run) {
  const made = element('button', className);
  if (sign) made.append(icon(sign));
  made.addEventListener('click', run);
  return made;
}

function makeRow(name) {
  const row = element('div', 'group');
  row.dataset.name = name ?? '';
  const choice = button('group-name', '', () => choose(name));
  choice.append(element('span', '', name ?? 'No group'), element('span', 'group-count'));
  if (name === null) {
    row.append(choice);
    return row;
  }
  choice.addEventListener('dblclick', () => askName(row, name, (now) => rename(name, now)));
  const eye = button('icon small eye', 'eye', () => changeOne(name, { hidden: !groupOf(name).hidden }));
  const bin = button('icon small bin', 'close', () => remove(name));
  bin.title = 'Delete the group; its strokes stay';
  bin.setAttribute('aria-label', `Delete the group ${name}`);
  row.append(eye, choice, bin);
  return row;
}

function show() {
  const names = state.groups.map(({ name }) => name);
  if (listed !== JSON.stringify(names)) {
    listed = JSON.stringify(names);
    list.replaceChildren(...(names.length > 0 ? [null, ...names] : []).map(makeRow));
  }
  byId('groups-hint').hidden = names.length > 0;
  const inHand = nameInHand();
  for (const row of list.querySelectorAll('.group')) showRow(row, inHand);
  byId('groups-of').textContent = selectedStroke() ? 'of this stroke' : '';
  showWeight(groupOf(inHand));
}

function showRow(row, inHand) {
  const group = groupOf(row.dataset.name);
  const choice = row.querySelector('.group-name');
  choice.setAttribute('aria-pressed', inHand === (group?.name ?? null));
  if (!group) return;
  choice.title = `${group.name}\nDouble-click renames`;
  row.classList.toggle('is-hidden', group.hidden);
  const count = state.strokes.flat().filter((stroke) => stroke.group === group.name).length;
  const share = group.weight < 1 ? `${Math.round(group.weight * 100)} %` : '';
  row.querySelector('.group-count').textContent = [share, count || ''].filter(Boolean).join(' · ');
  const eye = row.querySelector('.eye');
  eye.title = group.hidden ? 'Show its strokes' : 'Hide its strokes';
  eye.setAttribute('aria-label', `${group.hidden ? 'Show' : 'Hide'} the strokes of ${group.name}`);
  eye.querySelector('use').setAttribute('href', group.hidden ? '#icon-eye-shut' : '#icon-eye');
}

function showWeight(group) {
  weight.disabled = !group;
  byId('group-weight-box').hidden = state.groups.length === 0;
  if (document.activeElement === weight && weight.matches(':active')) return;
  weight.value = Math.round((group?.weight ?? 1) * 100);
  showShare();
}

function showShare() {
  const text = weight.disabled ? '' : `${weight.value} %`;
  byId('group-weight-value').textContent = text;
  weight.setAttribute('aria-valuetext', text);
  showFill(weight);
}

export function watchGroups() {
  byId('add-group').addEventListener('click', (event) => {
    // Not also a click on the section's title.
    event.preventDefault();
    askNew();
  });
  weight.addEventListener('input', showShare);
  weight.addEventListener('change', () => changeOne(nameInHand(), { weight: weight.value / 100 }));
  listen('strokes', () => {
    dropGroup();
    if (selectedStroke() && !isShown(selectedStroke())) select(null);
  });
  listen('strokes groups selection scene', show);
  show();
}
