// Mouse, pen and fingers over the picture: which gesture begins, and where it goes.

import { state, listen, tell, remember } from './state.js';
import { activePane, paneAt, panBy, panes, seenBox, toPicture, wipeLine, zoomAt } from './camera.js';
import { chooseColor, makeActive, moveWipe, returnFromPick, scaleRadius } from './actions.js';
import { cancelStroke, endStroke, extendStroke, startStroke } from './brush.js';
import { cancelMove, endMove, move, startMove } from './select.js';
import { GRIP_RADIUS } from './overlay.js';
import { dolly, orbit, slide } from './free.js';
import { send } from './socket.js';

const canvas = document.getElementById('view-canvas');
const ERASER_BUTTON = 5; // the other end of a pen
const touches = new Map(); // fingers, by pointer

let gesture = null; // { kind, view, id, last }
let lastReach = '';

const pointOf = (event) => {
  const box = canvas.getBoundingClientRect();
  const pressure = event.pointerType === 'pen' ? event.pressure : undefined;
  return { x: event.clientX - box.left, y: event.clientY - box.top, pressure };
};

// By how far the hand went since the gesture's last step.
function stepTo(point) {
  const { last } = gesture;
  gesture.last = point;
  return [point.x - last.x, point.y - last.y];
}

// A gesture keeps its view, but zoom and pan may change under way.
const placeOf = () => panes().find(({ view }) => view === gesture.view) ?? activePane();

const kinds = {
  stroke: {
    move: (place, points, event) => extendStroke(place, points, { isStraight: event.shiftKey }),
    end: (place, point) => endStroke(place, point),
    cancel: cancelStroke,
  },
  move: {
    move: (place, points) => move(place, points.at(-1)),
    end: endMove,
    cancel: cancelMove,
  },
  pick: {
    move: (place, points) => reach(place, points.at(-1)),
    end: returnFromPick,
    cancel: returnFromPick,
  },
  wipe: { move: (place, points) => dragWipe(place, points.at(-1)) },
  // What a click in the picture is for just now.
  ask: {
    move: (place, points) => state.asks?.move?.(place.view, toPicture(place, points.at(-1))),
    end: () => state.asks?.end?.(),
  },
  pan: {
    move: (place, points) => panBy(place, ...stepTo(points.at(-1))),
  },
  orbit: {
    move: (place, points) => orbit(...stepTo(points.at(-1))),
  },
  slide: {
    move: (place, points) => slide(place, ...stepTo(points.at(-1))),
  },
};

function kindFor(event, place, point) {
  if (state.free) {
    if (event.button === 1 || (event.button === 0 && (event.shiftKey || state.spaceHeld))) return 'slide';
    return event.button === 0 ? 'orbit' : null;
  }
  if (event.button === 1 || (event.button === 0 && state.spaceHeld)) return 'pan';
  if (event.button !== 0 && event.button !== ERASER_BUTTON) return null;
  if (isOnWipe(place, point)) return 'wipe';
  if (state.asks) return 'ask';
  if (event.altKey || state.tool === 'pick') return 'pick';
  return state.tool === 'select' ? 'move' : 'stroke';
}

function isOnWipe(place, { x, y }) {
  if (state.seen !== 'wipe' || !place || state.free) return false;
  const { top, height } = seenBox(place);
  const away = Math.abs(x - wipeLine(place));
  const isOnGrip = Math.hypot(away, y - top - height / 2) <= GRIP_RADIUS + 3;
  return isOnGrip || (away <= 4 && y >= top && y <= top + height);
}

function dragWipe(place, { x }) {
  const { left, width } = seenBox(place);
  if (width > 0) moveWipe((x - left) / width);
}

function isInPicture(place, point) {
  const [x, y] = toPicture(place, point);
  return x >= 0 && y >= 0 && x < place.size[0] && y < place.size[1];
}

function reach({ view, ...place }, point) {
  const [x, y] = toPicture(place, point).map(Math.floor);
  if (!isInPicture(place, point) || lastReach === `${view} ${x} ${y}`) return;
  lastReach = `${view} ${x} ${y}`;
  send({ type: 'reach', view, x, y });
}

export function closeSheet() {
  const open = document.querySelector(':popover-open');
  open?.hidePopover();
  return open !== null;
}

function begin(event) {
  // A press beside an open sheet closes it and does nothing else.
  if (closeSheet()) return;
  const point = pointOf(event);
  const place = paneAt(point);
  canvas.focus({ preventScroll: true });
  if (!place) return;
  const kind = kindFor(event, place, point);
  if (!kind) return;
  event.preventDefault();
  makeActive(place.view);
  gesture = { kind, view: place.view, id: event.pointerId, last: point, free: state.free };
  if (kind === 'stroke') startStroke(place, point, { isErasing: state.tool === 'eraser' || event.button === ERASER_BUTTON });
  if (kind === 'move') startMove(place, point);
  if (kind === 'ask' && isInPicture(place, point)) state.asks.begin(place.view, toPicture(place, point));
  if (kind === 'pick') {
    lastReach = '';
    reach(place, point);
  }
}

export function cancelGesture() {
  if (!gesture) return false;
  kinds[gesture.kind].cancel?.();
  gesture = null;
  return true;
}

function end(event, isCancelled) {
  if (gesture?.id !== event.pointerId) return;
  if (isCancelled) {
    cancelGesture();
    return;
  }
  kinds[gesture.kind].end?.(placeOf(), pointOf(event));
  gesture = null;
}

// Two fingers zoom and pan; what the first one had begun is taken back.
function pinch(event) {
  const before = spread();
  touches.set(event.pointerId, pointOf(event));
  const now = spread();
  const place = paneAt(before.middle);
  if (!place) return;
  const step = [now.middle.x - before.middle.x, now.middle.y - before.middle.y];
  if (state.free) {
    slide(place, ...step);
    if (now.width > 0) dolly(before.width / now.width);
    return;
  }
  panBy(place, ...step);
  if (before.width > 0) zoomAt(paneAt(before.middle), now.middle, now.width / before.width);
}

function spread() {
  const [one, other] = touches.values();
  const middle = { x: (one.x + other.x) / 2, y: (one.y + other.y) / 2 };
  return { middle, width: Math.hypot(one.x - other.x, one.y - other.y) };
}

function down(event) {
  canvas.setPointerCapture(event.pointerId);
  if (event.pointerType === 'pen') notePen();
  if (event.pointerType === 'touch') {
    touches.set(event.pointerId, pointOf(event));
    if (touches.size === 2) cancelGesture();
    if (touches.size > 1) return;
  }
  if (!gesture) begin(event);
  hover(event);
}

function notePen() {
  if (state.penSeen) return;
  state.penSeen = true;
  remember();
  tell('pen');
}

function moved(event) {
  hover(event);
  if (touches.size === 2 && touches.has(event.pointerId)) {
    pinch(event);
    return;
  }
  if (gesture?.id !== event.pointerId) return;
  const parts = event.getCoalescedEvents?.() ?? [];
  const points = (parts.length > 0 ? parts : [event]).map(pointOf);
  kinds[gesture.kind].move(placeOf(), points, event);
}

function up(event, isCancelled) {
  touches.delete(event.pointerId);
  end(event, isCancelled);
  hover(event);
}

function hover(event) {
  const point = pointOf(event);
  const isOver = event.type !== 'pointerleave' && event.pointerType !== 'touch';
  state.pointer = isOver ? { ...point, isOnWipe: gesture ? gesture.kind === 'wipe' : isOnWipe(paneAt(point), point) } : null;
  state.altHeld = event.altKey;
  tell('pointer');
}

function wheel(event) {
  event.preventDefault();
  const lines = event.deltaMode === WheelEvent.DOM_DELTA_LINE ? 30 : 1;
  const amount = event.deltaY * lines;
  const place = paneAt(pointOf(event));
  if (!place || amount === 0) return;
  if (state.asks?.slide && event.altKey) state.asks.slide(-amount / 100);
  else if (state.free) dolly(Math.exp(amount * (Math.abs(amount) < 40 ? 0.005 : 0.0012)));
  else if (event.ctrlKey || event.metaKey) {
    // A pinch comes as small steps, a wheel as large ones.
    zoomAt(place, pointOf(event), Math.exp(-amount * (Math.abs(amount) < 40 ? 0.01 : 0.002)));
  } else {
    scaleRadius(Math.exp(-amount * 0.0012));
  }
}

// The ring is the cursor where there is one.
function showCursor() {
  let cursor = 'none';
  if (['pan', 'orbit', 'slide'].includes(gesture?.kind)) cursor = 'grabbing';
  else if (state.spaceHeld || state.free) cursor = 'grab';
  else if (state.pointer?.isOnWipe) cursor = 'ew-resize';
  else if (state.asks || state.altHeld || state.tool === 'pick') cursor = 'crosshair';
  else if (state.tool === 'select') cursor = 'default';
  canvas.style.cursor = cursor;
}

export function watchPointer() {
  canvas.addEventListener('pointerdown', down);
  canvas.addEventListener('pointermove', moved);
  canvas.addEventListener('pointerup', (event) => up(event, false));
  canvas.addEventListener('pointercancel', (event) => up(event, true));
  canvas.addEventListener('pointerleave', hover);
  canvas.addEventListener('wheel', wheel, { passive: false });
  canvas.addEventListener('contextmenu', (event) => event.preventDefault());
  listen('pointer tool free asks', showCursor);
  // Nothing goes on that had begun before the camera was taken, or among views that were others.
  listen('free', () => {
    if (gesture && state.free !== gesture.free) cancelGesture();
  });
  listen('scene', ({ isMoved }) => isMoved && cancelGesture());
  listen('reached', ({ color }) => chooseColor(color));
}
