// The page's script: finds the page's elements, shows the asset, and obeys the switch and the keys.
import { dress, uniforms } from './occlusion.js';
import { bytesOf, loaded } from './loading.js';
import { rendererOn, stageOf } from './stage.js';

const MODES = { on: [1, 0], off: [0, 0], alone: [1, 1] }; // values of the two uniforms
const FADE_MS = 160;

const element = (id) => document.getElementById(id);

async function main() {
  let renderer;
  try {
    renderer = rendererOn(element('view'));
  } catch {
    return fail('This browser shows no 3D here: WebGL is missing or switched off.');
  }
  try {
    const asset = await loaded(bytesOf(element('asset')));
    const found = await dress(asset);
    element('asset').remove(); // it may be large
    const stage = stageOf(renderer, asset.scene);
    tell(found);
    obeySwitch(stage);
    obeyKeys(stage);
    element('reset').addEventListener('click', stage.frame);
    element('message').hidden = true;
    requestAnimationFrame(() => setState('ready'));
  } catch (error) {
    fail(`The asset could not be shown: ${error?.message ?? error}`);
  }
}

function setState(state) {
  document.documentElement.dataset.state = state;
}

function fail(text) {
  element('message').textContent = text;
  element('message').hidden = false;
  element('controls').disabled = true;
  setState('failed');
}

/** Say where the occlusion is, and what the switch cannot tell apart. */
function tell(found) {
  const places = [
    found.colors && 'in vertex colours',
    found.texture && 'in an occlusion texture',
    found.attribute && 'in the attribute _AO',
  ].filter(Boolean);
  let note = '';
  if (found.tinted) note = 'Its vertex colours hold colours of its own as well: off leaves out both, alone shows both.';
  else if (found.unmarked) note = 'Its grey vertex colours are taken for ambient occlusion.';
  const where = places.length ? `ambient occlusion ${places.join(' and ')}` : 'no ambient occlusion';
  element('facts').textContent = [element('facts').textContent, where].filter(Boolean).join(' · ');
  element('note').textContent = note;
}

function obeySwitch(stage) {
  const choices = [...document.querySelectorAll('input[name="ao"]')];
  const chosen = () => choices.find((choice) => choice.checked).value;
  const first = location.hash.slice(1); // page.html#off begins without
  if (first in MODES) choices.find((choice) => choice.value === first).checked = true;
  [uniforms.aoAmount.value, uniforms.aoAlone.value] = MODES[chosen()];
  for (const choice of choices) choice.addEventListener('change', () => fade(stage, MODES[chosen()]));
}

let fading = 0;

/** From the present values to others, at once where motion is not wanted. */
function fade(stage, [amount, alone]) {
  const from = [uniforms.aoAmount.value, uniforms.aoAlone.value];
  const still = matchMedia('(prefers-reduced-motion: reduce)').matches;
  const began = performance.now();
  cancelAnimationFrame(fading);
  function step(now) {
    const t = still ? 1 : Math.min(Math.max((now - began) / FADE_MS, 0), 1);
    uniforms.aoAmount.value = from[0] + (amount - from[0]) * t;
    uniforms.aoAlone.value = from[1] + (alone - from[1]) * t;
    stage.draw();
    if (t < 1) fading = requestAnimationFrame(step);
  }
  fading = requestAnimationFrame(step);
}

function obeyKeys(stage) {
  const press = (mode) => document.querySelector(`input[name="ao"][value="${mode}"]`).click();
  const isOn = (mode) => document.querySelector(`input[name="ao"][value="${mode}"]`).checked;
  const everywhere = {
    a: () => press(isOn('off') ? 'on' : 'off'),
    o: () => press(isOn('alone') ? 'on' : 'alone'),
    r: stage.frame,
    '+': () => stage.zoom(1),
    '=': () => stage.zoom(1),
    '-': () => stage.zoom(-1),
  };
  const inView = {
    ArrowLeft: () => stage.turn(1, 0),
    ArrowRight: () => stage.turn(-1, 0),
    ArrowUp: () => stage.turn(0, 1),
    ArrowDown: () => stage.turn(0, -1),
  };
  document.addEventListener('keydown', (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const known = event.target === element('view') ? { ...everywhere, ...inView } : everywhere;
    const act = known[event.key.length === 1 ? event.key.toLowerCase() : event.key];
    if (!act) return;
    event.preventDefault();
    act();
  });
}

main();
