// The card of the selected body.
import { FrameFlag } from '../gen/viewer_pb';
import type { Bodies } from '../model/bodies';
import { css, worldColour } from '../draw/colours';
import { h, iconButton, setText } from './dom';
import { digits, mass } from './words';

export interface InspectorHost {
  follow(): void;
  remove(): void;
  close(): void;
  following(): boolean;
  mayAct(): boolean;
  whyNot(): string;
}

const flagNames: [FrameFlag, string, string][] = [
  [FrameFlag.FLAG_ASLEEP, 'asleep', 'It rests; steps cost nothing for it'],
  [FrameFlag.FLAG_NEAR, 'near a border', 'Other worlds are told of it'],
  [FrameFlag.FLAG_MIXED, 'mixed island', 'It touches, directly or through others, bodies of another world'],
  [FrameFlag.FLAG_REDONE, 'done again', 'Its state was rolled back and computed again'],
];

export class Inspector {
  private title = h('h2');
  private values = new Map<string, HTMLElement>();
  private flags = h('div', { class: 'flags' });
  private followButton: HTMLButtonElement;
  private removeButton: HTMLButtonElement;

  constructor(
    private readonly root: HTMLElement,
    private readonly bodies: Bodies,
    private readonly host: InspectorHost,
  ) {
    this.followButton = iconButton({ icon: 'follow', label: 'Follow', key: 'F', pressed: false, click: () => host.follow() });
    this.removeButton = iconButton({ icon: 'remove', label: 'Remove', key: 'Delete', click: () => host.remove() });
    const close = iconButton({ icon: 'close', label: 'Deselect', key: 'Esc', click: () => host.close() });
    const grid = h('dl', { class: 'values' });
    for (const name of ['world', 'mass', 'speed', 'position']) {
      const value = h('dd');
      this.values.set(name, value);
      grid.append(h('div', { class: name === 'position' ? 'wide' : '' }, h('dt', {}, name), value));
    }
    root.append(h('div', { class: 'card-head' }, this.title, this.followButton, this.removeButton, close), grid, this.flags);
  }

  update(body: number): void {
    this.root.hidden = body < 0;
    if (body < 0) return;
    const { bodies } = this;
    const present = !!bodies.present[body];
    setText(this.title, `Body ${bodies.ids[body]}`);
    const at = [0, 1, 2].map((c) => bodies.pos[3 * body + c]!.toFixed(2));
    const world = bodies.world[body]!;
    const values: Record<string, string> = {
      world: String(world),
      mass: mass(bodies.mass[body]!),
      speed: present ? `${digits(bodies.speed[body]!)} m/s` : '–',
      position: present ? `${at.join(', ')} m` : 'not in the scene at this step',
    };
    for (const [name, value] of this.values) setText(value, values[name]!);
    this.values.get('world')!.style.setProperty('--world', css(worldColour(world)));
    const set = flagNames.filter(([flag]) => present && bodies.flags[body]! & flag);
    const wanted = set.map(([, name]) => name).join();
    if (this.flags.dataset.shown !== wanted) {
      this.flags.dataset.shown = wanted;
      this.flags.replaceChildren(...set.map(([, name, meaning]) => h('span', { class: 'chip', title: meaning }, name)));
    }
    this.followButton.setAttribute('aria-pressed', String(this.host.following()));
    this.removeButton.disabled = !this.host.mayAct();
    if (this.removeButton.disabled) this.removeButton.title = this.host.whyNot();
  }
}
