// How finely the scene is drawn. Left to itself it begins well where there is graphics hardware, and goes down when
// pictures come too slowly for some seconds.
import type { LevelName } from './draw/looks';
import type { SettingsStore } from './settings';

const lower: Record<LevelName, LevelName | null> = { high: 'medium', medium: 'low', low: 'minimal', minimal: null };
const tooSlow = 40; // pictures per second
const patience = 4; // s

export class QualityChooser {
  level: LevelName;
  private slowFor = 0;

  constructor(
    private readonly settings: SettingsStore,
    software: boolean,
    private readonly apply: (level: LevelName) => void,
  ) {
    const auto: LevelName = software ? 'low' : 'high';
    this.level = settings.now.quality === 'auto' ? auto : settings.now.quality;
    apply(this.level);
    settings.onChange((now, key) => {
      if (key === 'quality') this.set(now.quality === 'auto' ? auto : now.quality);
    });
  }

  // Once a second.
  measured(fps: number): void {
    if (this.settings.now.quality !== 'auto' || document.hidden) return;
    this.slowFor = fps < tooSlow ? this.slowFor + 1 : 0;
    const next = lower[this.level];
    if (this.slowFor < patience || !next) return;
    this.set(next);
  }

  private set(level: LevelName): void {
    this.slowFor = 0;
    this.level = level;
    this.apply(level);
  }
}
