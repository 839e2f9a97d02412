// The connection to the server: it reconnects by itself, decodes what comes, and loses no stroke.

import { state, listen, tell } from './state.js';
import { middleOf, resetCameras } from './camera.js';
import { distance } from './strokes.js';

const RETRY_MS = 1000;
const BATCH = 50; // strokes at once after a reconnect; the server takes 200 messages a second
const LARGEST = 1e6; // the server hangs up on messages above 1 MiB

let socket = null;
let watched = '';
// Strokes that no list of the server has shown yet: painted without connection, or sent into one that was lost.
let unconfirmed = [];

export function connect() {
  const token = new URLSearchParams(location.search).get('token') ?? '';
  const scheme = location.protocol === 'https:' ? 'wss' : 'ws';
  socket = new WebSocket(`${scheme}://${location.host}/socket?token=${encodeURIComponent(token)}`);
  socket.binaryType = 'arraybuffer';
  socket.onmessage = ({ data }) => (typeof data === 'string' ? receive(JSON.parse(data)) : receivePicture(data));
  socket.onclose = () => {
    setSocket('closed');
    setTimeout(connect, RETRY_MS);
  };
}

function setSocket(word) {
  if (state.socket === word) return;
  state.socket = word;
  tell('socket');
}

export const isOpen = () => state.socket === 'open';

export function send(message) {
  if (!isOpen()) return;
  const text = JSON.stringify(message);
  if (text.length <= LARGEST) socket.send(text);
  else tell('notice', { kind: 'error', text: 'This has too many points to be changed here.' });
}

// A stroke is kept until the server lists it, and sent again if the connection is lost before.
export function sendPaint(view, stroke) {
  const entry = { view, stroke, isSent: isOpen() };
  unconfirmed.push(entry);
  send({ type: 'paint', view, stroke });
}

export const unsentCount = () => unconfirmed.filter(({ isSent }) => !isSent).length;

function flush() {
  const batch = unconfirmed.filter(({ isSent }) => !isSent).slice(0, BATCH);
  if (!isOpen() || batch.length === 0) return;
  for (const entry of batch) {
    entry.isSent = true;
    send({ type: 'paint', view: entry.view, stroke: entry.stroke });
  }
  setTimeout(flush, 500);
}

const receivers = {
  hello: receiveHello,
  strokes: receiveStrokes,
  progress: receiveProgress,
  exporting: receiveExporting,
  look: ({ sun, sigma_t, span }) => tell('look', { sun, sigma_t, span }),
  looks: ({ type, ...looks }) => tell('looks-told', looks),
  reached: (message) => tell('reached', message),
  seen: (message) => tell('part', message),
  notice: receiveNotice,
};

function receive(message) {
  receivers[message.type]?.(message);
}

function receiveHello(hello) {
  const isNew = !isOpen();
  const isOther = state.scene?.path !== hello.path;
  const old = state.views;
  // Where each of the old views is now, or -1.
  const places = isOther ? old.map(() => -1) : old.map(({ name, size }) =>
    hello.views.findIndex((view) => view.name === name && `${view.size}` === `${size}`));
  const isMoved = places.some((place, view) => place !== view);
  state.scene = hello;
  state.views = hello.views;
  if (isNew) forgetCounts();
  if (isOther) {
    unconfirmed = [];
    state.pictures.clear();
    state.baseExposure = hello.exposure;
  }
  moveViews(places);
  watched = '';
  setSocket('open');
  if (isNew) {
    // First the exposure: the pictures that are asked for come with it.
    sendExposure();
    // An export ends with its server.
    receiveExporting({ is_running: false });
  }
  watch();
  tell('scene', { isMoved });
}

// A server that has started again counts from the beginning. What the lost connection took along is unsure until the list of strokes comes.
function forgetCounts() {
  for (const entry of unconfirmed) entry.isSent = false;
  for (const picture of state.pictures.values()) picture.serial = -1;
  for (const entry of state.pending) entry.revision = -1;
}

// What is known of views goes where they are now: a view that was added or went away leaves the others as they were.
function moveViews(places) {
  const { cameras, strokes } = state;
  resetCameras();
  state.strokes = state.views.map(() => []);
  places.forEach((now, view) => {
    if (now < 0) return;
    state.cameras[now] = cameras[view] ?? middleOf(state.views[now]);
    state.strokes[now] = strokes[view] ?? [];
  });
  const isKept = ({ view }) => (places[view] ?? -1) >= 0;
  const moved = (entry) => (entry && isKept(entry) ? { ...entry, view: places[entry.view] } : null);
  unconfirmed = unconfirmed.filter(isKept).map(moved);
  state.pending = state.pending.filter(isKept).map(moved);
  for (const name of ['selection', 'draft', 'live']) state[name] = moved(state[name]);
  state.pictures = new Map([...state.pictures].flatMap(([key, picture]) => {
    const [kind, view] = key.split('/');
    if (view === 'null') return [[key, picture]];
    return (places[view] ?? -1) >= 0 ? [[`${kind}/${places[view]}`, picture]] : [];
  }));
  const view = places[state.view] ?? -1;
  state.view = view >= 0 ? view : Math.min(state.view, state.views.length - 1);
}

function receiveStrokes(message) {
  state.strokes = message.views;
  state.groups = (message.groups ?? []).map(({ name, hidden = false, weight = 1 }) => ({ name, hidden, weight }));
  state.revision = message.revision;
  state.canUndo = message.can_undo;
  state.canRedo = message.can_redo;
  state.isSaved = message.is_saved;
  // Only a stroke that was sent can be confirmed, and one in the list confirms only one.
  const free = message.views.map((strokes) => [...strokes]);
  unconfirmed = unconfirmed.filter(({ view, stroke }) => {
    const others = free[view] ?? [];
    const at = others.findLastIndex((other) => isSameStroke(stroke, other));
    if (at >= 0) others.splice(at, 1);
    return at < 0;
  });
  flush();
  tell('strokes');
}

// Numbers may come back rounded.
function isSameStroke(one, other) {
  const ends = [0, -1].every((at) => distance(one.points.at(at), other.points.at(at)) < 0.02);
  return ends && Math.abs(one.radius - other.radius) < 0.02;
}

function receiveProgress(progress) {
  state.progress = progress;
  tell('progress');
}

function receiveExporting(message) {
  state.isExporting = message.is_running;
  tell('exporting', message);
}

// After an error no stroke waits for its light any more: the refused one would wait forever.
function receiveNotice({ kind, text }) {
  if (kind === 'error') {
    state.pending = [];
    unconfirmed = unconfirmed.filter(({ isSent }) => !isSent);
    tell('marks');
  }
  tell('notice', { kind, text });
}

function receivePicture(buffer) {
  const length = new DataView(buffer).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  const { kind, view, size, stage, serial, revision } = header;
  const key = `${kind}/${view}`;
  const old = state.pictures.get(key);
  if (old && serial < old.serial) return;
  const bytes = new Uint8ClampedArray(buffer, 4 + length, size[0] * size[1] * 4);
  // Pixels go onto a canvas only when they are drawn: of several in one frame only the newest costs anything.
  state.pictures.set(key, { size, stage, serial, revision, bytes, canvas: old?.canvas, isNew: true });
  if (kind === 'after') state.pending = state.pending.filter((entry) => entry.view !== view || entry.revision >= revision);
  tell('picture', { kind, view });
}

// Before and after are always at hand, so that looking back is at once; the rest comes when it is shown.
function watch() {
  const pictures = ['after', 'before'];
  if (state.seen === 'target' || state.seen === 'difference') pictures.push(state.seen);
  if (state.showsReach) pictures.push('coverage');
  if (state.showsConflicts) pictures.push('conflict');
  if (state.showsLightMap) pictures.push('light_map');
  if (state.asks?.veil) pictures.push('depth');
  if (watched === `${pictures}` || !isOpen()) return;
  watched = `${pictures}`;
  send({ type: 'watch', pictures });
}

export function sendExposure() {
  send({ type: 'exposure', value: state.baseExposure * 2 ** state.stops });
}

listen('seeing asks', watch);
