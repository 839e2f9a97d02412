// The line at the bottom: what the solver does, how far it is, its curve of convergence, and an export under way.

import { state, listen } from './state.js';
import { activePane } from './camera.js';
import { fitCanvas } from './canvas.js';
import { byId, element } from './dom.js';
import { unsentCount } from './socket.js';

const status = byId('status');
const curve = byId('curve');
const CURVE = { width: 120, height: 20 };
const MOST_POINTS = 600;
const MOSTLY = 0.8; // of the paint

let gradients = []; // of the last solve
let last = null;

function met({ met: share }) {
  if (share === null || share === undefined) return '';
  // Not 100 % before all of it is.
  return `${share >= 1 ? 100 : Math.floor(share * 100)} % of the paint met`;
}

const WORDS = {
  preview: (progress) => `Improving… ${met(progress)}`,
  full: (progress) => `Full resolution… ${met(progress)}`,
  done: (progress) => (met(progress) ? `Done, ${met(progress)}` : 'Done'),
  'nothing painted': () => 'Paint a stroke to begin',
};

function phaseText() {
  if (state.socket !== 'open') {
    const unsent = unsentCount();
    const kept = unsent > 0 ? `, ${unsent} stroke${unsent === 1 ? '' : 's'} kept` : '';
    return state.socket === 'connecting' ? 'Connecting…' : `Waiting${kept}`;
  }
  if (!state.progress) return 'Starting…';
  if (state.pending.length > 0) return 'Working…';
  return WORDS[state.progress.phase]?.(state.progress) ?? state.progress.phase;
}

function showPhase() {
  byId('phase').textContent = phaseText();
  status.dataset.phase = state.progress?.phase ?? '';
  status.dataset.met = state.progress?.met ?? '';
  byId('lamp').dataset.state = lampState();
}

// Green is for paint that is met.
function lampState() {
  if (state.socket !== 'open') return 'closed';
  if (state.pending.length > 0) return 'preview';
  const { phase = '', met: share } = state.progress ?? {};
  return phase === 'done' && share < MOSTLY ? 'partly' : phase;
}

function numbersText({ phase, iteration, gradient }) {
  if (phase === 'nothing painted' || !(iteration > 0)) return '';
  return `iteration ${iteration}, gradient ${gradient === null ? '–' : gradient.toExponential(1).replace('-', '−')}`;
}

function showProgress() {
  const { progress } = state;
  const isNew = progress.phase === 'preview' && (last?.phase !== 'preview' || progress.iteration < last.iteration);
  if (isNew || progress.phase === 'nothing painted') gradients = [];
  if (progress.gradient > 0 && progress.phase !== 'done') gradients.push(progress.gradient);
  if (gradients.length > MOST_POINTS) gradients = gradients.filter((_, index) => index % 2 === 0);
  last = progress;
  byId('numbers').textContent = numbersText(progress);
  byId('numbers').disabled = numbersText(progress) === '';
  showPhase();
  drawCurve();
}

function drawCurve() {
  const context = curve.getContext('2d');
  const { width, height } = CURVE;
  context.clearRect(0, 0, width, height);
  if (gradients.length < 2) return;
  const logs = gradients.map(Math.log);
  const highest = Math.max(...logs);
  const range = Math.max(highest - Math.min(...logs), 1);
  context.beginPath();
  logs.forEach((value, index) => {
    const x = 1 + (index / (logs.length - 1)) * (width - 2);
    context.lineTo(x, 2 + ((highest - value) / range) * (height - 4));
  });
  context.strokeStyle = getComputedStyle(curve).color;
  context.lineWidth = 1.5;
  context.lineJoin = 'round';
  context.stroke();
}

function showExport({ text, part, is_running: isRunning }) {
  byId('export-state').hidden = !isRunning;
  byId('tool-hint').hidden = isRunning;
  if (!isRunning) return;
  byId('export-text').textContent = `Export: ${text}`;
  const bar = byId('export-bar');
  if (part === null) bar.removeAttribute('value');
  else bar.value = part;
}

function showZoom() {
  const place = activePane();
  if (!place) return;
  byId('zoom').textContent = `${Math.round(place.scale * 100)} %`;
}

function showSocket() {
  byId('banner').hidden = state.socket !== 'closed';
  showPhase();
}

// What stands in the way of the paint, as the command would warn of it.
function showRemarks() {
  const remarks = state.progress?.remarks ?? [];
  const button = byId('remarks');
  button.hidden = remarks.length === 0;
  button.textContent = remarks.length === 1 ? '1 remark' : `${remarks.length} remarks`;
  if (remarks.length === 0 && byId('remarks-list').matches(':popover-open')) byId('remarks-list').hidePopover();
  byId('remarks-list').replaceChildren(...remarks.map((text) => element('p', '', text)));
}

function showDetails() {
  const details = state.progress?.details ?? [];
  byId('details').replaceChildren(...details.flatMap(([label, value]) => [element('dt', '', label), element('dd', '', value)]));
  byId('details-wait').hidden = details.length > 0;
}

export function watchStatus() {
  curve.style.width = `${CURVE.width}px`;
  curve.style.height = `${CURVE.height}px`;
  fitCanvas(curve, CURVE);
  listen('progress', showProgress);
  listen('progress', showRemarks);
  listen('progress', showDetails);
  listen('socket', showSocket);
  listen('exporting', showExport);
  listen('marks picture', showPhase);
  listen('camera scene seeing view', showZoom);
  listen('theme', drawCurve);
  showPhase();
}
