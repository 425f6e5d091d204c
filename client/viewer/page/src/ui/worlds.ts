// The panel on the right: one card per world, what it does and how it is. One that is silent or that the others wait for
// is red.
import { css, worldColour } from '../draw/colours';
import type { Session } from '../model/session';
import { h, setText } from './dom';
import { drawSpark } from './spark';
import { bytes, count, digits, percent } from './words';

// Cards that are open at first; of more worlds, or in a small window, the others are closed.
const openAtFirst = () => (window.innerWidth < 720 ? 0 : 4);

interface Card {
  root: HTMLDetailsElement;
  badge: HTMLElement;
  brief: HTMLElement;
  values: Map<string, HTMLElement>;
  plots: { load: HTMLCanvasElement; lead: HTMLCanvasElement; rollbacks: HTMLCanvasElement };
}

const fields: [string, string][] = [
  ['clock', 'newest computed step'],
  ['final', 'newest step that can never change'],
  ['syncs', 'messages exchanged with neighbours, per second'],
  ['bodies', 'dynamic bodies it owns'],
  ['rollbacks', 'repairs so far'],
  ['redone', 'results of bodies that were done again'],
  ['waits', 'for which world, and how much of the time'],
  ['memory', 'at most so far'],
];

export class WorldsPanel {
  private cards: Card[] = [];
  private head: HTMLElement;
  private list: HTMLElement;
  private seenSyncs: { at: number; value: number; rate: number }[] = [];

  constructor(
    root: HTMLElement,
    private readonly session: Session,
  ) {
    this.head = h('div', { class: 'panel-head' });
    this.list = h('div', { class: 'cards' });
    root.append(this.head, this.list);
  }

  clear(): void {
    this.cards = [];
    this.seenSyncs = [];
    this.list.replaceChildren();
  }

  // When the gateway has told of the worlds.
  update(now: number): void {
    const { worlds, rows } = this.session;
    const number = Math.max(worlds.length, rows.length);
    while (this.cards.length < number) this.addCard();
    this.head.hidden = number === 0; // of a recording
    const bodies = worlds.reduce((sum, w) => sum + Number(w.bodies), 0);
    setText(this.head, `${number === 1 ? '1 world' : `${number} worlds`} · ${count(bodies)} bodies`);
    for (let w = 0; w < number; w++) this.updateCard(w, now);
  }

  // What is wrong with a world, or nothing.
  trouble(world: number): { short: string; long: string } | null {
    const row = this.session.rows[world];
    if (row?.silent || this.session.worlds[world]?.state === 'silent')
      return { short: 'silent', long: 'Nothing has been heard of it for some time; the others wait for it.' };
    const behind = this.session.behind(world);
    if (behind) return { short: `${behind} behind`, long: `Its final step is ${behind} steps behind the others'.` };
    return null;
  }

  private updateCard(w: number, now: number): void {
    const card = this.cards[w]!;
    const state = this.session.worlds[w];
    const row = this.session.rows[w];
    const trouble = this.trouble(w);
    card.root.classList.toggle('bad', trouble !== null);
    setText(card.badge, trouble?.short ?? state?.state ?? '…');
    card.badge.title = trouble?.long ?? '';
    if (!state) return;
    setText(card.brief, `${percent(state.load)} · +${Number(state.lead)}`);
    card.brief.title = `load · lead: its clock is ${Number(state.lead)} steps beyond its final step`;
    const set = (name: string, text: string) => setText(card.values.get(name)!, text);
    set('clock', row ? count(row.clock) : '–');
    set('final', row ? count(row.final) : '–');
    set('syncs', count(Math.round(this.syncRate(w, Number(state.syncs), now))));
    set('bodies', count(state.bodies));
    set('rollbacks', count(state.rollbacks));
    set('redone', count(state.bodiesRedone));
    set('waits', `${state.waitingFor >= 0 ? `for ${state.waitingFor}, ` : ''}${percent(state.waiting)}`);
    set('memory', bytes(Number(state.memory)));
    card.root.title = `${state.host} pid ${state.pid} · ${count(state.cells)} cells · ${state.neighbours} neighbours · ${digits(state.stepsPerSecond)} steps/s · ${bytes(state.bytesPerSecond)}/s to neighbours · ${digits(state.cpu)} cores · ${count(state.refused)} messages refused`;
    const history = this.session.history[w];
    if (!history || !card.root.open) return;
    drawSpark(card.plots.load, history.load, now, { colour: plotColour('load'), least: 1 });
    drawSpark(card.plots.lead, history.lead, now, { colour: plotColour('lead'), least: 8 });
    drawSpark(card.plots.rollbacks, history.rollbacks, now, { colour: plotColour('redone'), least: 10 });
  }

  private syncRate(w: number, value: number, now: number): number {
    const seen = (this.seenSyncs[w] ??= { at: now, value, rate: 0 });
    if (now - seen.at > 0.8) {
      seen.rate = Math.max(0, value - seen.value) / (now - seen.at);
      seen.at = now;
      seen.value = value;
    }
    return seen.rate;
  }

  private addCard(): void {
    const w = this.cards.length;
    const badge = h('span', { class: 'badge' });
    const brief = h('span', { class: 'brief' });
    const values = new Map<string, HTMLElement>();
    const grid = h('dl', { class: 'values' });
    for (const [name, meaning] of fields) {
      const value = h('dd');
      values.set(name, value);
      grid.append(h('div', { title: meaning }, h('dt', {}, name), value));
    }
    const plot = (label: string) => {
      const canvas = h('canvas', { class: 'spark', role: 'img', 'aria-label': `${label} of world ${w} over the last minute` });
      return [canvas, h('figure', {}, canvas, h('figcaption', {}, label))] as const;
    };
    const [load, loadBox] = plot('load');
    const [lead, leadBox] = plot('lead');
    const [rollbacks, rollbacksBox] = plot('redone/s');
    const root = h(
      'details',
      { class: 'card world' },
      h(
        'summary',
        {},
        h('span', { class: 'dot', style: `background:${css(worldColour(w))}` }),
        h('span', { class: 'name' }, `world ${w}`),
        badge,
        brief,
      ),
      grid,
      h('div', { class: 'plots' }, loadBox, leadBox, rollbacksBox),
    );
    root.open = w < openAtFirst();
    root.addEventListener('toggle', () => this.updateCard(w, performance.now() / 1000));
    this.list.append(root);
    this.cards.push({ root, badge, brief, values, plots: { load, lead, rollbacks } });
  }
}

const plotColour = (name: 'load' | 'lead' | 'redone') =>
  getComputedStyle(document.documentElement).getPropertyValue(`--plot-${name}`).trim();
