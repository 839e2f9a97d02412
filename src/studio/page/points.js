// The transfer function as the panel shows it: its layers, its axes, and its points.

import { state } from './state.js';
import { cssColor } from './colour.js';

export const RADIUS = 6; // pixels

// Of each axis: what it is by, the words at its ends, and a short word.
export const WORDS = {
  visibility: { by: 'Light', from: 'in shade', to: 'in full light', short: 'light' },
  depth: { by: 'Depth', from: 'near', to: 'far', short: 'depth' },
  position: { by: 'Place of the light', from: 'lit near', to: 'lit far', short: 'place' },
  angle: { by: 'Angle to the sun', from: 'to the sun', to: 'away', short: 'angle' },
};

const transfer = () => state.looks?.looks.transfer;

// Whether the panel can show it: it may have a form that is not known here.
export const isDrawn = () => Array.isArray(transfer()?.layers);
export const layersOf = () => (isDrawn() ? transfer().layers : []);
export const axesOf = () => transfer()?.axes ?? ['visibility', 'depth'];
export const pointsOf = (layer) => layersOf()[layer]?.diffusion?.points ?? [];

// All points, with their places on both axes: as they say, or where the server has found them.
export function placedPoints() {
  return layersOf().flatMap((_, layer) => pointsOf(layer).flatMap((point, number) => {
    const at = point.at ?? state.looks.places[layer]?.[number];
    return at ? [{ layer, number, point, at }] : [];
  }));
}

// Those of a view's pixels.
export const pointsIn = (view) => layersOf().flatMap((_, layer) => pointsOf(layer).flatMap((point, number) =>
  (point.pixel && point.view === state.views[view]?.name ? [{ layer, number, point }] : [])));

export const isInHand = (layer, number) => state.point?.layer === layer && state.point.number === number;

// A dot of its colour with rings that show on every picture.
export function drawPoint(pen, x, y, { color }, isChosen) {
  const radius = isChosen ? RADIUS + 1 : RADIUS - 1;
  pen.beginPath();
  pen.arc(x, y, radius, 0, 2 * Math.PI);
  pen.fillStyle = cssColor(color);
  pen.fill();
  for (const [line, thick] of [['rgb(0 0 0 / 65%)', isChosen ? 5 : 3.5], ['#fff', isChosen ? 2.5 : 1.5]]) {
    pen.strokeStyle = line;
    pen.lineWidth = thick;
    pen.stroke();
  }
}
