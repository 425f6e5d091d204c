// Help and settings, as the browser's own dialogs: they keep the keyboard inside and close with Esc.
import type { Quality, Settings, SettingsStore, Theme } from '../settings';
import { h, iconButton } from './dom';

const shortcuts: [string, string][] = [
  ['drag · right drag · wheel', 'turn, move, zoom'],
  ['click', 'select a body'],
  ['double click, F', 'follow a body'],
  ['Home', 'show everything'],
  ['Ctrl + drag', 'grab a body; the wheel moves it nearer or farther'],
  ['1 2 3 4', 'select, grab, push, add'],
  ['Delete', 'remove the selected body'],
  ['space', 'pause, resume'],
  ['.', 'one step, while paused'],
  ['← →', 'look one step back or ahead; with Shift ten'],
  ['L', 'live: the displayed step again'],
  ['K', 'hold the step that is shown'],
  ['C', 'next colouring'],
  ['B', 'territories and borders'],
  ['N M', 'bodies near borders; islands of several worlds'],
  ['R', 'flash what was rolled back'],
  ['W', 'panel of the worlds'],
  ['T', 'light or dark'],
  ['P', 'save a picture'],
  [',', 'settings'],
  ['? H', 'this help'],
  ['Esc', 'back to selecting; deselect'],
];

const words: [string, string][] = [
  ['world', 'a process that simulates the bodies in its territory, the cells it owns'],
  ['displayed step', 'the step that the session shows now; the worlds are ahead of it'],
  ['anticipated', 'computed before all neighbours had got that far: may still change'],
  ['rollback', 'what was anticipated turned out otherwise, and is done again'],
  ['final', 'can never change'],
  ['clock', "a world's newest computed step"],
  ['mixed island', 'bodies in contact that belong to several worlds'],
];

function dialog(title: string, ...content: Node[]): HTMLDialogElement {
  const element = h('dialog', { 'aria-label': title });
  element.append(
    h('div', { class: 'card-head' }, h('h2', {}, title), iconButton({ icon: 'close', label: 'Close', key: 'Esc', click: () => element.close() })),
    ...content,
  );
  element.addEventListener('click', (event) => {
    if (event.target === element) element.close(); // beside it
  });
  document.body.append(element);
  return element;
}

const toggle = (element: HTMLDialogElement) => () => (element.open ? element.close() : element.showModal());

export function helpDialog(): () => void {
  const keys = h('dl', { class: 'keys' });
  for (const [key, does] of shortcuts) keys.append(h('div', {}, h('dt', {}, h('kbd', {}, key)), h('dd', {}, does)));
  const meanings = h('dl', { class: 'keys' });
  for (const [word, means] of words) meanings.append(h('div', {}, h('dt', {}, word), h('dd', {}, means)));
  return toggle(dialog('Help', h('div', { class: 'columns' }, keys, h('div', {}, h('h3', {}, 'Words'), meanings))));
}

export interface SettingsHost {
  quality(): string; // what is in force
  copyLink(withToken: boolean): void;
  hasToken(): boolean;
}

export function settingsDialog(settings: SettingsStore, host: SettingsHost): () => void {
  const refreshers: (() => void)[] = [];
  const choice = <K extends 'theme' | 'quality'>(key: K, label: string, options: [Settings[K], string][]) => {
    const select = h('select');
    for (const [value, text] of options) select.append(h('option', { value }, text));
    select.addEventListener('change', () => settings.set(key, select.value as Settings[K]));
    refreshers.push(() => (select.value = settings.now[key]));
    return h('label', { class: 'setting' }, h('span', {}, label), select);
  };
  const box = (key: 'redone' | 'cutaway' | 'grid' | 'labels' | 'ticker' | 'panel', label: string) => {
    const input = h('input', { type: 'checkbox' });
    input.addEventListener('change', () => settings.set(key, input.checked));
    refreshers.push(() => (input.checked = settings.now[key]));
    return h('label', { class: 'setting' }, h('span', {}, label), input);
  };
  const number = (key: 'speedScale' | 'pushSpeed', label: string, low: number, high: number, step: number) => {
    const input = h('input', { type: 'number', min: low, max: high, step });
    input.addEventListener('change', () => settings.set(key, Math.min(high, Math.max(low, Number(input.value)))));
    refreshers.push(() => (input.value = String(settings.now[key])));
    return h('label', { class: 'setting' }, h('span', {}, label), input);
  };
  const quality = h('p', { class: 'note' });
  refreshers.push(() => (quality.textContent = `In force: ${host.quality()}.`));
  const withToken = h('input', { type: 'checkbox' });
  const copy = h('button', { type: 'button', class: 'text-button primary' }, 'Copy link');
  copy.addEventListener('click', () => host.copyLink(withToken.checked));
  const tokenRow = h('label', { class: 'setting' }, h('span', {}, 'With my right to act (the token)'), withToken);
  refreshers.push(() => (tokenRow.hidden = !host.hasToken()));

  const element = dialog(
    'Settings',
    choice('theme', 'Theme', [
      ['auto' as Theme, 'as the system'],
      ['dark', 'dark'],
      ['light', 'light'],
    ]),
    choice('quality', 'Quality', [
      ['auto' as Quality, 'by the speed of this machine'],
      ['high', 'high'],
      ['medium', 'medium'],
      ['low', 'low'],
      ['minimal', 'lowest'],
    ]),
    quality,
    box('redone', 'Flash bodies that were rolled back'),
    box('cutaway', 'Leave out walls in front of the bodies'),
    box('grid', 'Lines on floors'),
    box('labels', 'Names of territories'),
    box('ticker', 'Tell what happens, at the lower left'),
    number('speedScale', 'Colour by speed: m/s at the bright end (0: by the bodies)', 0, 200, 0.1),
    number('pushSpeed', 'Push: change of speed, m/s', 0.1, 100, 0.1),
    h('h3', {}, 'Link to this view'),
    tokenRow,
    copy,
  );
  const show = toggle(element);
  return () => {
    for (const refresh of refreshers) refresh();
    show();
  };
}
