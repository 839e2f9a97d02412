// Where the views' pictures lie on the stage: panes, zoom and pan.

import { state, tell } from './state.js';

const MARGIN = 16;
const GAP = 12;
const LABEL = 24; // room for a view's name when all are shown
const ZOOMS = [0.25, 32];

const clamp = (value, low, high) => Math.min(high, Math.max(low, value));

export const middleOf = ({ size }) => ({ zoom: 1, x: size[0] / 2, y: size[1] / 2 });

export function resetCameras() {
  state.cameras = state.views.map(middleOf);
}

// A pane: the box that a view has on the stage, and the scale and corner of its picture there.
export function panes() {
  if (state.views.length === 0) return [];
  const { width, height } = state.stage;
  const whole = { x: 0, y: 0, width, height };
  if (state.free) return [pane(state.free.view, whole, MARGIN, middleOf(state.views[state.free.view]))];
  if (!state.showsAll) return [pane(state.view, whole, MARGIN)];
  const columns = bestColumns();
  return state.views.map((_, view) => pane(view, cell(view, columns), 0));
}

export const activePane = () => panes().find(({ view }) => view === state.view);

function fitScale({ width, height }, [across, down], margin) {
  return Math.max(0.01, Math.min((width - 2 * margin) / across, (height - 2 * margin) / down));
}

function pane(view, box, margin, camera = state.cameras[view]) {
  const { size } = state.views[view];
  const scale = fitScale(box, size, margin) * camera.zoom;
  const x = box.x + box.width / 2 - camera.x * scale;
  const y = box.y + box.height / 2 - camera.y * scale;
  return { view, box, size, scale, x, y };
}

function cell(index, columns) {
  const rows = Math.ceil(state.views.length / columns);
  const width = (state.stage.width - 2 * MARGIN - (columns - 1) * GAP) / columns;
  const height = (state.stage.height - 2 * MARGIN - (rows - 1) * GAP) / rows;
  const column = index % columns;
  const row = Math.floor(index / columns);
  // A last row that is not full stands in the middle.
  const inRow = Math.min(columns, state.views.length - row * columns);
  const shift = ((columns - inRow) * (width + GAP)) / 2;
  return {
    x: MARGIN + shift + column * (width + GAP),
    y: MARGIN + row * (height + GAP) + LABEL,
    width: Math.max(1, width),
    height: Math.max(1, height - LABEL),
  };
}

function bestColumns() {
  const smallest = (columns) =>
    Math.min(...state.views.map(({ size }, index) => fitScale(cell(index, columns), size, 0)));
  let best = 1;
  for (let columns = 2; columns <= state.views.length; columns += 1) {
    if (smallest(columns) > smallest(best)) best = columns;
  }
  return best;
}

export function paneAt({ x, y }) {
  return panes().find(({ box }) => x >= box.x && y >= box.y && x < box.x + box.width && y < box.y + box.height);
}

export const toPicture = (place, { x, y }) => [(x - place.x) / place.scale, (y - place.y) / place.scale];

// The part of the picture that is seen in its pane.
export function seenBox({ box, x, y, size, scale }) {
  const left = Math.max(box.x, x);
  const top = Math.max(box.y, y);
  const right = Math.min(box.x + box.width, x + size[0] * scale);
  const bottom = Math.min(box.y + box.height, y + size[1] * scale);
  return { left, top, width: Math.max(0, right - left), height: Math.max(0, bottom - top) };
}

export const wipeLine = (place) => {
  const { left, width } = seenBox(place);
  return left + state.wipe * width;
};

// The picture's point below the pointer stays there.
export function zoomAt(place, point, factor) {
  const camera = state.cameras[place.view];
  const zoom = clamp(camera.zoom * factor, ...ZOOMS);
  const scale = (place.scale * zoom) / camera.zoom;
  const [x, y] = toPicture(place, point);
  camera.zoom = zoom;
  camera.x = x - (point.x - place.box.x - place.box.width / 2) / scale;
  camera.y = y - (point.y - place.box.y - place.box.height / 2) / scale;
  keepInSight(place);
}

export function panBy(place, across, down) {
  const camera = state.cameras[place.view];
  camera.x -= across / place.scale;
  camera.y -= down / place.scale;
  keepInSight(place);
}

function keepInSight({ view, size }) {
  const camera = state.cameras[view];
  camera.x = clamp(camera.x, 0, size[0]);
  camera.y = clamp(camera.y, 0, size[1]);
  tell('camera');
}

export function zoomBy(factor) {
  const place = activePane();
  if (!place || state.free) return;
  const { box } = place;
  zoomAt(place, { x: box.x + box.width / 2, y: box.y + box.height / 2 }, factor);
}

export function fit() {
  resetCameras();
  tell('camera');
}
