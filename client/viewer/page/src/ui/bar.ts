// The bar at the top: which session this is, how it is, and the page's own buttons.
import type { Session } from '../model/session';
import type { SettingsStore } from '../settings';
import { h, iconButton, setIcon, setText } from './dom';
import { count } from './words';

export interface BarHost {
  screenshot(): void;
  copyLink(): void;
  settings(): void;
  help(): void;
  dark(): boolean;
}

export class Bar {
  private name = h('strong', { class: 'session' });
  private scene = h('span', { class: 'scene' });
  private rights = h('span', { class: 'chip rights', hidden: true });
  private trouble = h('span', { class: 'chip trouble', role: 'status', 'aria-live': 'polite', hidden: true });
  private fps = h('span', { class: 'fps', title: 'Pictures per second, and bodies drawn' });
  private theme: HTMLButtonElement;
  private panel: HTMLButtonElement;

  constructor(
    root: HTMLElement,
    private readonly session: Session,
    private readonly settings: SettingsStore,
    private readonly host: BarHost,
  ) {
    this.theme = iconButton({ icon: 'sun', label: 'Light or dark', key: 'T', click: () => this.toggleTheme() });
    this.panel = iconButton({ icon: 'panel', label: 'Worlds', key: 'W', pressed: true, click: () => settings.toggle('panel') });
    root.append(
      h('span', { class: 'brand', 'aria-hidden': 'true' }, 'SODA'),
      this.name,
      this.scene,
      this.rights,
      this.trouble,
      h('span', { class: 'spacer' }),
      this.fps,
      iconButton({ icon: 'camera', label: 'Save a picture', key: 'P', click: () => host.screenshot() }),
      iconButton({ icon: 'link', label: 'Copy a link to this view', click: () => host.copyLink() }),
      this.theme,
      this.panel,
      iconButton({ icon: 'settings', label: 'Settings', key: ',', click: () => host.settings() }),
      iconButton({ icon: 'help', label: 'Help', key: '?', click: () => host.help() }),
    );
    settings.onChange(() => this.show());
    this.show();
  }

  toggleTheme(): void {
    this.settings.set('theme', this.host.dark() ? 'light' : 'dark');
  }

  show(): void {
    setIcon(this.theme, this.host.dark() ? 'sun' : 'moon');
    this.panel.setAttribute('aria-pressed', String(this.settings.now.panel));
    const welcome = this.session.welcome;
    if (!welcome) return;
    setText(this.name, welcome.session);
    setText(this.scene, welcome.scene);
    document.title = `${welcome.session} · SODA`;
    this.rights.hidden = welcome.mayAct && !welcome.replay;
    setText(this.rights, welcome.replay ? 'recording' : 'read-only');
    this.rights.title = welcome.replay
      ? 'A recording: nothing can be done to bodies'
      : 'This link has no token: you can look, but not act';
  }

  // Worlds in trouble are named where nobody overlooks it, whether the panel is open or not.
  showTrouble(texts: string[]): void {
    this.trouble.hidden = texts.length === 0;
    setText(this.trouble, texts.join(' · '));
  }

  showRate(fps: number, bodies: number): void {
    setText(this.fps, `${Math.round(fps)} fps · ${count(bodies)} bodies`);
  }
}
