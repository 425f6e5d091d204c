// The column of tools at the left: what the pointer does, what is shown, and how bodies are coloured.
import type { ColourBy, Settings, SettingsStore, SpawnShape, Tool } from '../settings';
import { h, iconButton, type IconName } from './dom';

export interface ToolbarHost {
  choose(tool: Tool): void;
  mayAct(): boolean;
  whyNot(): string;
  follow(): void;
  home(): void;
  spawnHere(): void;
}

const tools: { tool: Tool; icon: IconName; label: string; key: string }[] = [
  { tool: 'select', icon: 'select', label: 'Select and look around', key: '1' },
  { tool: 'grab', icon: 'grab', label: 'Grab: drag a body on a spring', key: '2, or Ctrl and drag' },
  { tool: 'push', icon: 'push', label: 'Push: click on a body', key: '3' },
  { tool: 'spawn', icon: 'spawn', label: 'Add a body where you click', key: '4' },
];

type Switch = 'borders' | 'near' | 'mixed' | 'redone';
const switches: { setting: Switch; icon: IconName; label: string; key: string }[] = [
  { setting: 'borders', icon: 'borders', label: 'Territories and borders', key: 'B' },
  { setting: 'near', icon: 'near', label: 'Point out bodies near borders', key: 'N' },
  { setting: 'mixed', icon: 'mixed', label: 'Point out islands of several worlds', key: 'M' },
  { setting: 'redone', icon: 'redone', label: 'Flash bodies that were rolled back', key: 'R' },
];

const colourings: [ColourBy, string][] = [
  ['body', 'by body'],
  ['world', 'by world'],
  ['speed', 'by speed'],
  ['sleep', 'by sleep'],
];

export class Toolbar {
  private toolButtons = new Map<Tool, HTMLButtonElement>();
  private switchButtons = new Map<Switch, HTMLButtonElement>();
  private colour: HTMLSelectElement;
  private options: HTMLElement;
  private tool: Tool = 'select';

  constructor(
    root: HTMLElement,
    private readonly settings: SettingsStore,
    private readonly host: ToolbarHost,
  ) {
    const group = (label: string, ...buttons: Node[]) => h('div', { class: 'tool-group', role: 'group', 'aria-label': label }, ...buttons);
    for (const { tool, icon, label, key } of tools)
      this.toolButtons.set(tool, iconButton({ icon, label, key, pressed: tool === 'select', click: () => host.choose(tool) }));
    for (const { setting, icon, label, key } of switches)
      this.switchButtons.set(setting, iconButton({ icon, label, key, pressed: false, click: () => settings.toggle(setting) }));
    this.colour = h('select', { 'aria-label': 'Colour bodies', title: 'Colour bodies (C: the next)' });
    for (const [value, text] of colourings) this.colour.append(h('option', { value }, text));
    this.colour.addEventListener('change', () => settings.set('colour', this.colour.value as ColourBy));
    this.options = h('div', { class: 'card tool-options', hidden: true });
    root.append(
      group('Tools', ...this.toolButtons.values()),
      group('Shown', ...this.switchButtons.values()),
      group(
        'Camera',
        iconButton({ icon: 'follow', label: 'Follow the selected body', key: 'F', click: () => host.follow() }),
        iconButton({ icon: 'home', label: 'Show everything', key: 'Home', click: () => host.home() }),
      ),
      group('Colours', this.colour),
      this.options,
    );
    settings.onChange((now) => this.show(now));
    this.show(settings.now);
  }

  setTool(tool: Tool): void {
    this.tool = tool;
    for (const [name, button] of this.toolButtons) button.setAttribute('aria-pressed', String(name === tool));
    this.showOptions();
  }

  // What may be done may have changed.
  update(): void {
    const may = this.host.mayAct();
    for (const { tool, label, key } of tools) {
      const button = this.toolButtons.get(tool)!;
      if (tool === 'select' || button.disabled === !may) continue;
      button.disabled = !may;
      button.title = may ? `${label} (${key})` : `${label}: ${this.host.whyNot()}`;
    }
    if (!may && this.tool !== 'select') this.host.choose('select');
  }

  private show(now: Settings): void {
    for (const [setting, button] of this.switchButtons) button.setAttribute('aria-pressed', String(now[setting]));
    this.colour.value = now.colour;
  }

  private showOptions(): void {
    const now = this.settings.now;
    this.options.hidden = this.tool === 'select' || this.tool === 'grab';
    if (this.tool === 'push')
      this.options.replaceChildren(
        this.slider('Change of speed', 'm/s', 0.5, 30, now.pushSpeed, (v) => this.settings.set('pushSpeed', v)),
      );
    if (this.tool === 'spawn') {
      const shapes = h('select', { 'aria-label': 'Shape' });
      for (const shape of ['box', 'sphere', 'capsule']) shapes.append(h('option', { value: shape }, shape));
      shapes.value = now.spawnShape;
      shapes.addEventListener('change', () => this.settings.set('spawnShape', shapes.value as SpawnShape));
      const here = h('button', { type: 'button', class: 'text-button' }, 'Add in front of me');
      here.addEventListener('click', () => this.host.spawnHere());
      this.options.replaceChildren(
        h('label', {}, 'Shape ', shapes),
        this.slider('Size', 'm', 0.1, 3, now.spawnSize, (v) => this.settings.set('spawnSize', v)),
        here,
      );
    }
  }

  private slider(label: string, unit: string, low: number, high: number, value: number, changed: (value: number) => void): HTMLElement {
    const input = h('input', { type: 'range', min: low, max: high, step: 0.1, value });
    const output = h('output', {}, `${value} ${unit}`);
    input.addEventListener('input', () => {
      output.textContent = `${input.value} ${unit}`;
      changed(Number(input.value));
    });
    return h('label', { class: 'slider' }, h('span', {}, label), input, output);
  }
}
