// The page's address: it says how the scene is looked at, so that a link shows another person the same. The token, which
// is the right to act, is read from it and stays out of what is copied unless the user wants it in.
import type { CameraState } from './draw/views';
import { colourModes, type ColourBy, type Quality, type SettingsStore, type Theme } from './settings';

const switches = { b: 'borders', n: 'near', m: 'mixed' } as const;
const settle = 400; // ms without a change until the address is written

export class Link {
  readonly token: string | null;
  camera: CameraState | null = null; // that the page was opened with
  private tokenInHash: boolean;
  private timer = 0;

  constructor(
    private readonly settings: SettingsStore,
    private readonly cameraNow: () => CameraState,
    moved: (camera: CameraState) => void, // by a link that is pasted over the open page
  ) {
    const hash = new URLSearchParams(location.hash.slice(1));
    const query = new URLSearchParams(location.search);
    this.tokenInHash = hash.has('token');
    this.token = query.get('token') ?? hash.get('token');
    this.read(hash);
    settings.onChange(() => this.changed());
    window.addEventListener('hashchange', () => {
      this.read(new URLSearchParams(location.hash.slice(1)));
      if (this.camera) moved(this.camera);
      this.camera = null;
    });
  }

  changed(): void {
    clearTimeout(this.timer);
    this.timer = window.setTimeout(() => {
      const hash = this.write(this.tokenInHash);
      if (hash !== location.hash) history.replaceState(null, '', `${location.pathname}${location.search}${hash}`);
    }, settle);
  }

  url(withToken: boolean): string {
    const query = new URLSearchParams(location.search);
    query.delete('token');
    const rest = query.toString();
    return `${location.origin}${location.pathname}${rest ? `?${rest}` : ''}${this.write(withToken)}`;
  }

  private read(hash: URLSearchParams): void {
    const numbers = (hash.get('cam') ?? '').split(',').map(Number);
    if (numbers.length === 6 && numbers.every(Number.isFinite)) {
      const [a, b, c, d, e, f] = numbers as [number, number, number, number, number, number];
      this.camera = { position: [a, b, c], target: [d, e, f] };
    }
    const colour = hash.get('colour');
    if (colour && colourModes.includes(colour as ColourBy)) this.settings.set('colour', colour as ColourBy);
    const show = hash.get('show');
    if (show !== null)
      for (const [letter, setting] of Object.entries(switches)) this.settings.set(setting, show.includes(letter));
    const theme = hash.get('theme');
    if (theme === 'dark' || theme === 'light') this.settings.set('theme', theme as Theme);
    const quality = hash.get('quality');
    if (quality) this.settings.set('quality', quality as Quality); // whatever else it says is not taken
  }

  private write(withToken: boolean): string {
    const { position, target } = this.cameraNow();
    const now = this.settings.now;
    const parts = [
      `cam=${[...position, ...target].map((x) => String(Number(x.toPrecision(6)))).join(',')}`,
      `colour=${now.colour}`,
    ];
    const show = Object.entries(switches)
      .filter(([, setting]) => now[setting])
      .map(([letter]) => letter)
      .join('');
    parts.push(`show=${show}`);
    if (now.theme !== 'auto') parts.push(`theme=${now.theme}`);
    if (withToken && this.token) parts.push(`token=${encodeURIComponent(this.token)}`);
    return `#${parts.join('&')}`;
  }
}
