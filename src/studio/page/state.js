// The one state of the page, word of its changes, and what is remembered from visit to visit.

export const state = {
  socket: 'connecting',
  scene: null, // what hello said
  views: [],
  strokes: [], // by view, as the server last told
  groups: [], // { name, hidden, weight }
  revision: 0, // which change of them that was
  canUndo: false,
  canRedo: false,
  isSaved: true,
  pictures: new Map(), // by "kind/view"
  progress: null,
  look: { sun: null, sigma_t: null, span: 1 }, // what of the light and the fog can be changed
  looks: null, // { looks, names, texels, metres_per_unit, far, places, isTold }: how shafts are bent and coloured; null for a volume
  isExporting: false,

  view: 0,
  cameras: [], // by view
  stage: { width: 1, height: 1 },
  seen: 'after',
  peeks: false, // shows before while a key is held
  wipe: 0.5,
  showsAll: false,
  showsReach: false,
  showsConflicts: false,
  showsOutlines: false,
  showsLightMap: false,
  showsPoints: false, // those of the transfer function that views have given
  stops: 0,
  baseExposure: 1,

  tool: 'brush',
  brush: { color: '#ff9620', radius: 0, hardness: 0.8, opacity: 1 }, // the radius waits for a picture to fit
  group: null, // the name of the one that new strokes go into
  ownColors: [],
  theme: '',
  penSeen: false,
  penPressure: true,
  closed: ['looks-section'], // sections of the panel
  selection: null, // { view, number }
  draft: null, // { view, number, stroke }: the selected stroke while it is changed
  point: null, // { layer, number }: the chosen one of the transfer function
  asks: null, // { hint, begin, … }: what a click in the picture is for, in place of the brush
  live: null, // { view, stroke, pressures, tip }: the stroke under way
  pending: [], // strokes whose light has not been seen yet
  free: null, // { view, camera, … }: the free camera, while it flies
  pointer: null, // where it hovers over the picture, in pixels of the page
  spaceHeld: false,
  altHeld: false,

  drawnAt: 0,
  drawnRevision: -1, // the change that the picture drawn last shows
  strokeEndedAt: 0,
};

const listeners = new Map();

export function listen(topics, run) {
  for (const topic of topics.split(' ')) {
    if (!listeners.has(topic)) listeners.set(topic, []);
    listeners.get(topic).push(run);
  }
}

export function tell(topic, detail) {
  for (const run of listeners.get(topic) ?? []) run(detail);
}

const STORE = 'unscatter-paint';

// A browser may forbid storage altogether, or hold what an older page wrote: then the defaults stand.
export function recall() {
  try {
    const kept = JSON.parse(localStorage.getItem(STORE)) ?? {};
    const { color, radius, hardness, opacity } = kept.brush ?? {};
    const brush = state.brush;
    if (/^#[0-9a-f]{6}$/.test(color)) brush.color = color;
    if (radius > 0 && radius <= 4096) brush.radius = radius;
    if (hardness >= 0 && hardness <= 1) brush.hardness = hardness;
    if (opacity > 0 && opacity <= 1) brush.opacity = opacity;
    if (Array.isArray(kept.ownColors)) {
      state.ownColors = kept.ownColors.filter((own) => /^#[0-9a-f]{6}$/.test(own)).slice(0, 8);
    }
    if (kept.theme === 'dark' || kept.theme === 'light') state.theme = kept.theme;
    state.penSeen = kept.penSeen === true;
    state.penPressure = kept.penPressure !== false;
    if (Array.isArray(kept.closed)) state.closed = kept.closed;
  } catch {
    return;
  }
}

export function remember() {
  const { brush, ownColors, theme, penSeen, penPressure, closed } = state;
  try {
    localStorage.setItem(STORE, JSON.stringify({ brush, ownColors, theme, penSeen, penPressure, closed }));
  } catch {
    return;
  }
}
