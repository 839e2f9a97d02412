// A plane across a view: what is before it, from how deep the view is at each pixel of its preview.

import { state } from './state.js';

const NEAR = 0.03; // surfaces so near to the plane are marked, as a share of its distance
const NOTHING = 2 ** 24 - 1; // no surface

const veils = new Map(); // by view: { serial, distance, canvas }

// Straight ahead, in units of the scene. Of 24 bits that the picture has in red, green and blue: the logarithm, from 2⁻⁶⁴ to 2⁶⁴.
function depthOf(bytes, pixel) {
  const code = bytes[4 * pixel] * 65536 + bytes[4 * pixel + 1] * 256 + bytes[4 * pixel + 2];
  return code === NOTHING ? Infinity : 2 ** ((code / NOTHING) * 128 - 64);
}

// At a point of the full picture; null where there is no surface, or nothing is known yet.
export function depthAt(view, [x, y]) {
  const picture = state.pictures.get(`depth/${view}`);
  if (!picture) return null;
  const [width, height] = picture.size;
  const at = (value, side, full) => Math.min(side - 1, Math.max(0, Math.floor((value / full) * side)));
  const [fullWidth, fullHeight] = state.views[view].size;
  const depth = depthOf(picture.bytes, at(y, height, fullHeight) * width + at(x, width, fullWidth));
  return Number.isFinite(depth) ? depth : null;
}

// Dark where surfaces hide the plane, bright where they are at it; null where nothing is known yet.
export function veilOf(view, distance) {
  const picture = state.pictures.get(`depth/${view}`);
  if (!picture) return null;
  const known = veils.get(view);
  if (known?.serial === picture.serial && known.distance === distance) return known.canvas;
  const canvas = known?.canvas ?? document.createElement('canvas');
  const [width, height] = picture.size;
  Object.assign(canvas, { width, height });
  const veil = new ImageData(width, height);
  for (let pixel = 0; pixel < width * height; pixel += 1) {
    const depth = depthOf(picture.bytes, pixel);
    if (Math.abs(depth - distance) < NEAR * distance) veil.data.set([90, 200, 255, 150], 4 * pixel);
    else if (depth < distance) veil.data.set([0, 0, 0, 130], 4 * pixel);
  }
  canvas.getContext('2d').putImageData(veil, 0, 0);
  veils.set(view, { serial: picture.serial, distance, canvas });
  return canvas;
}
