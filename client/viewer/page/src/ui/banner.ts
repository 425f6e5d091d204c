// The message in the middle, when there is nothing to see or nothing more to come; and short ones at the top.
import type { LinkState } from '../net/connection';
import type { Session } from '../model/session';
import { protocol } from '../model/session';
import { h, setText } from './dom';

export interface BannerHost {
  reconnect(): void;
  link(): LinkState;
}

export class Banner {
  private title = h('h2');
  private text = h('p');
  private button: HTMLButtonElement;
  private dismissed = '';

  constructor(
    private readonly root: HTMLElement,
    private readonly session: Session,
    private readonly host: BannerHost,
  ) {
    this.button = h('button', { type: 'button', class: 'text-button primary' });
    this.button.addEventListener('click', () => {
      if (this.button.dataset.does === 'connect') host.reconnect();
      else this.dismissed = this.title.textContent ?? '';
      this.update();
    });
    root.append(this.title, this.text, this.button);
  }

  update(): void {
    const said = this.message();
    const hide = !said || this.dismissed === said.title;
    if (!said) this.dismissed = '';
    this.root.hidden = hide;
    if (hide) return;
    this.root.dataset.kind = said.kind;
    setText(this.title, said.title);
    setText(this.text, said.text);
    this.button.hidden = !said.button;
    this.button.dataset.does = said.button?.does ?? '';
    setText(this.button, said.button?.text ?? '');
  }

  private message(): { kind: string; title: string; text: string; button?: { text: string; does: 'connect' | 'dismiss' } } | null {
    const { session } = this;
    const link = this.host.link();
    if (session.ended)
      return {
        kind: session.ended.failed ? 'bad' : 'info',
        title: session.ended.failed ? 'The session has failed' : 'The session has ended',
        text: session.ended.reason || 'The gateway gave no reason.',
        button: { text: 'Look around', does: 'dismiss' },
      };
    if (link.kind === 'broken') {
      const seconds = Math.max(0, Math.ceil((link.retryAt - performance.now()) / 1000));
      return {
        kind: 'bad',
        title: session.welcome ? 'The connection is lost' : 'The gateway does not answer',
        text: `${link.reason ? `The gateway says: ${link.reason}. ` : ''}Next try in ${seconds} s.${session.welcome ? ' What you see is the last that was heard.' : ''}`,
        button: { text: 'Try now', does: 'connect' },
      };
    }
    if (link.kind === 'connecting')
      return { kind: 'info', title: 'Connecting …', text: session.welcome ? 'to the session again' : 'to the session' };
    if (!session.welcome)
      return session.clocks?.gathering
        ? { kind: 'info', title: 'The run has not begun', text: "Waiting for the session's worlds …" }
        : { kind: 'info', title: 'Connected', text: 'Waiting for the scene …' };
    if (session.welcome.protocol !== protocol)
      return {
        kind: 'bad',
        title: 'This page is of another version',
        text: `The gateway speaks version ${session.welcome.protocol}, this page ${protocol}. Load the page again, without the browser's copy (Ctrl+Shift+R).`,
        button: { text: 'Try anyway', does: 'dismiss' },
      };
    if (session.clocks?.gathering) {
      const there = session.worlds.filter((w) => w.state !== 'unknown' && w.state !== '').length;
      const ready = session.worlds.filter((w) => w.state === 'ready' || w.state === 'running').length;
      return {
        kind: 'info',
        title: 'The run has not begun',
        text: `Waiting for worlds: ${there} of ${session.welcome.worlds} are there, ${ready} ready.`,
      };
    }
    // Worlds that were killed, or that nothing comes from through the network, cannot say so.
    if (session.rows.length > 0 && session.rows.every((row) => row.silent))
      return {
        kind: 'bad',
        title: 'Nothing is heard of the session',
        text: 'All its worlds are silent: they were ended, or the network is broken. What you see is the last that was heard.',
        button: { text: 'Look around', does: 'dismiss' },
      };
    return null;
  }
}

// Short messages that go away by themselves.
export function toast(root: HTMLElement, text: string, kind: 'info' | 'bad' = 'info'): void {
  const same = [...root.children].find((child) => child.textContent === text);
  same?.remove();
  const shown = h('div', { class: `toast ${kind}` }, text);
  root.append(shown);
  while (root.children.length > 3) root.firstChild!.remove();
  setTimeout(() => shown.remove(), kind === 'bad' ? 6000 : 3500);
}
