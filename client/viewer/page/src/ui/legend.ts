// What the colours mean, where that is not obvious.
import { asleepColour, awakeColour, css, mixedColour, nearColour, speedRamp, worldColour } from '../draw/colours';
import type { Settings } from '../settings';
import { h } from './dom';
import { digits } from './words';

const mostWorlds = 12;

export function drawLegend(root: HTMLElement, settings: Settings, worlds: number, topSpeed: number): void {
  const entry = (colour: number, text: string) =>
    h('span', { class: 'entry' }, h('span', { class: 'dot', style: `background:${css(colour)}` }), text);
  const entries: HTMLElement[] = [];
  if (settings.colour === 'speed') {
    // The ramp is drawn over roots of speeds (colours.ts), so its numbers are squares.
    const stops = Array.from({ length: 9 }, (_, k) => css(speedRamp(k / 8))).join(',');
    const mark = (share: number) => h('span', { style: `left:${100 * share}%` }, digits(topSpeed * share * share, 2));
    entries.push(
      h(
        'div',
        { class: 'ramp' },
        h('div', { class: 'ramp-bar', style: `background:linear-gradient(90deg,${stops})` }),
        h('div', { class: 'ramp-marks' }, mark(0), mark(0.5), mark(1)),
        h('div', { class: 'ramp-unit' }, 'speed, m/s'),
      ),
    );
  }
  if (settings.colour === 'sleep') entries.push(entry(awakeColour, 'awake'), entry(asleepColour, 'asleep'));
  if (settings.colour === 'world' || settings.borders) {
    for (let w = 0; w < Math.min(worlds, mostWorlds); w++) entries.push(entry(worldColour(w), `world ${w}`));
    if (worlds > mostWorlds) entries.push(h('span', { class: 'entry' }, `and ${worlds - mostWorlds} more`));
  }
  if (settings.near) entries.push(entry(nearColour, 'near a border'));
  if (settings.mixed) entries.push(entry(mixedColour, 'in an island of several worlds'));
  root.hidden = entries.length === 0;
  root.replaceChildren(...entries);
}
