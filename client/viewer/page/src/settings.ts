// What the user has chosen about looks and tools. Kept in the browser; what says how the scene is looked at goes into the
// link, too (link.ts).

export type Theme = 'auto' | 'dark' | 'light';
export type ColourBy = 'body' | 'world' | 'speed' | 'sleep';
export type Tool = 'select' | 'grab' | 'push' | 'spawn';
export type SpawnShape = 'box' | 'sphere' | 'capsule';
export type Quality = 'auto' | 'high' | 'medium' | 'low' | 'minimal';

export interface Settings {
  theme: Theme;
  quality: Quality;
  colour: ColourBy;
  borders: boolean;
  near: boolean;
  mixed: boolean;
  redone: boolean;
  cutaway: boolean;
  grid: boolean;
  labels: boolean;
  panel: boolean;
  ticker: boolean;
  speedScale: number; // m/s at the top of the ramp; 0: by the bodies
  pushSpeed: number; // m/s that a push changes a body's velocity by
  spawnShape: SpawnShape;
  spawnSize: number; // m
}

export const defaults: Settings = {
  theme: 'auto',
  quality: 'auto',
  colour: 'body',
  borders: false,
  near: false,
  mixed: false,
  redone: true,
  cutaway: true,
  grid: true,
  labels: true,
  panel: true,
  ticker: true,
  speedScale: 0,
  pushSpeed: 5,
  spawnShape: 'box',
  spawnSize: 0.5,
};

// Values that a setting of words may have; whatever else is stored or linked is not taken.
const words: { [K in keyof Settings]?: readonly string[] } = {
  theme: ['auto', 'dark', 'light'],
  quality: ['auto', 'high', 'medium', 'low', 'minimal'],
  colour: ['body', 'world', 'speed', 'sleep'],
  spawnShape: ['box', 'sphere', 'capsule'],
};

export const colourModes: readonly ColourBy[] = ['body', 'world', 'speed', 'sleep'];

const storageKey = 'soda-viewer';
type Listener = (settings: Settings, changed: keyof Settings) => void;

export class SettingsStore {
  readonly now: Settings = { ...defaults };
  private listeners: Listener[] = [];

  constructor() {
    try {
      this.merge(JSON.parse(localStorage.getItem(storageKey) ?? '{}') as Record<string, unknown>);
    } catch {
      // Storage that is forbidden or damaged: the defaults do.
    }
  }

  onChange(listener: Listener): void {
    this.listeners.push(listener);
  }

  set<K extends keyof Settings>(key: K, value: Settings[K]): void {
    if (!fits(key, value) || this.now[key] === value) return;
    this.now[key] = value;
    try {
      localStorage.setItem(storageKey, JSON.stringify(this.now));
    } catch {
      // As above: it holds until the page is left.
    }
    for (const listener of this.listeners) listener(this.now, key);
  }

  toggle(key: { [K in keyof Settings]: Settings[K] extends boolean ? K : never }[keyof Settings]): void {
    this.set(key, !this.now[key]);
  }

  private merge(values: Record<string, unknown>): void {
    for (const key of Object.keys(defaults) as (keyof Settings)[])
      if (fits(key, values[key])) (this.now as unknown as Record<string, unknown>)[key] = values[key];
  }
}

function fits(key: keyof Settings, value: unknown): boolean {
  if (typeof value !== typeof defaults[key]) return false;
  if (typeof value === 'number') return Number.isFinite(value) && (value > 0 || (value === 0 && key === 'speedScale'));
  return words[key]?.includes(value as string) ?? true;
}
