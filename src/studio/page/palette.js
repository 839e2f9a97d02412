// The two pickers of colours: that of the brush, and one that opens beside the panel for a colour of the looks.

import { listen } from './state.js';
import { chooseColor, commit, paintInHand } from './actions.js';
import { byId } from './dom.js';
import { makePicker } from './picker.js';

const GAP = 10; // pixels from the panel and from the rim of the window

const sheet = byId('colour-sheet');

let asked = null; // { read, take, begin }: whose colour the sheet shows

// Opens the sheet beside what was clicked on.
function openSheet({ anchor, label, ...whose }) {
  asked = whose;
  byId('colour-of').textContent = label;
  sheet.showPopover();
  const [box, panel] = [anchor.getBoundingClientRect(), document.querySelector('.panel').getBoundingClientRect()];
  const top = Math.min(box.top - 40, window.innerHeight - sheet.offsetHeight - 42);
  sheet.style.left = `${panel.left - sheet.offsetWidth - GAP}px`;
  sheet.style.top = `${Math.max(GAP, top)}px`;
}

// The same parts once more.
function makeTwin() {
  const twin = byId('picker').cloneNode(true);
  for (const part of [twin, ...twin.querySelectorAll('[id]')]) part.removeAttribute('id');
  sheet.append(twin);
  return makePicker(twin, {
    read: () => asked?.read() ?? '#ffffff',
    take: (color) => asked?.take(color),
    begin: () => asked?.begin(),
  });
}

export function watchPalette() {
  const twin = makeTwin();
  const brush = makePicker(byId('picker'), { read: () => paintInHand().color, take: chooseColor, commit });
  const both = [brush, twin];
  sheet.addEventListener('toggle', ({ newState }) => {
    if (newState === 'closed') asked = null;
    else twin.show();
  });
  listen('ask-color', openSheet);
  listen('brush selection', brush.show);
  listen('looks', twin.show);
  listen('scene', () => both.forEach(({ showPalette }) => showPalette()));
  listen('colors', () => both.forEach(({ showOwn }) => showOwn()));
  both.forEach(({ showPalette }) => showPalette());
}
