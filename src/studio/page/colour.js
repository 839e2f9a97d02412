// Colours: hex, red-green-blue and hue-saturation-value.

const clamp = (value) => Math.min(1, Math.max(0, value));

function hexOf([red, green, blue]) {
  const byte = (part) => Math.round(clamp(part) * 255).toString(16).padStart(2, '0');
  return `#${byte(red)}${byte(green)}${byte(blue)}`;
}

function rgbOf(hex) {
  return [1, 3, 5].map((at) => parseInt(hex.slice(at, at + 2), 16) / 255);
}

// Reads what people type, with or without #, in three or six digits; null when it is no colour.
export function parseHex(text) {
  const digits = text.trim().replace(/^#/, '').toLowerCase();
  if (/^[0-9a-f]{6}$/.test(digits)) return `#${digits}`;
  if (/^[0-9a-f]{3}$/.test(digits)) return `#${[...digits].map((digit) => digit + digit).join('')}`;
  return null;
}

// Scene files may also hold linear numbers, which may lie above 1.
export function cssColor(color) {
  if (typeof color === 'string') return parseHex(color) ?? '#ffffff';
  const encode = (part) => (part <= 0.0031308 ? 12.92 * part : 1.055 * part ** (1 / 2.4) - 0.055);
  return hexOf(color.map((part) => encode(clamp(part))));
}

export function hsvOf(hex) {
  const [red, green, blue] = rgbOf(hex);
  const value = Math.max(red, green, blue);
  const spread = value - Math.min(red, green, blue);
  const saturation = value > 0 ? spread / value : 0;
  if (spread === 0) return { hue: 0, saturation, value };
  let hue = 4 + (red - green) / spread;
  if (value === red) hue = (green - blue) / spread;
  else if (value === green) hue = 2 + (blue - red) / spread;
  return { hue: (hue * 60 + 360) % 360, saturation, value };
}

export function hexOfHsv({ hue, saturation, value }) {
  const part = (shift) => {
    const turn = (shift + hue / 60) % 6;
    return value - value * saturation * clamp(Math.min(turn, 4 - turn));
  };
  return hexOf([part(5), part(3), part(1)]);
}
