// What happened, at the bottom left: repairs, answers, events. Repairs come by the dozen, so within a moment those of one
// world are told as one line; what the user caused is pointed out.
import type { RollbackRecord } from '../model/session';
import type { AnswerRecord } from '../net/requests';
import { css, worldColour } from '../draw/colours';
import { h } from './dom';
import { count, digits, plural } from './words';

const lines = 6;
// Not `move`, of which there are thirty a second, nor what the timeline shows.
const told = new Set(['push', 'grab', 'release', 'spawn', 'remove']);
const stays = 20; // s
const gather = 0.4; // s in which repairs of one world are one line
const causedWithin = 3; // s after an answer in which a repair from its step on is the user's

export class Ticker {
  private last: { world: number; at: number; record: RollbackRecord; more: number; text: HTMLElement }[] = [];
  private mine: { step: number; asked: string; at: number }[] = [];

  constructor(private readonly root: HTMLElement) {}

  clear(): void {
    this.root.replaceChildren();
    this.last = [];
    this.mine = [];
  }

  answered(answer: AnswerRecord, now: number): void {
    if (!answer.accepted) {
      this.line(`refused: ${answer.asked}: ${answer.reason}`, 'bad');
      return;
    }
    if (answer.step > 0 && told.has(answer.asked)) {
      this.mine.push({ step: answer.step, asked: answer.asked, at: now });
      if (this.mine.length > 30) this.mine.shift();
      const what = answer.asked === 'spawn' && answer.body > 0n ? `spawn of body ${answer.body}` : answer.asked;
      this.line(`your ${what}: done at step ${count(answer.step)}, answered in ${digits(answer.milliseconds, 2)} ms`, 'mine');
    }
  }

  rolledBack(record: RollbackRecord, now: number): void {
    const cause = this.mine.find(
      (m) => now - m.at < causedWithin && record.step >= m.step - 1 && record.step <= m.step + 1,
    );
    const last = this.last[record.world];
    if (!cause && last && now - last.at < gather && last.text.isConnected) {
      // The largest of them is told.
      last.more++;
      if (record.bodies > last.record.bodies) last.record = record;
      last.text.textContent = `${sentence(last.record)} (and ${last.more} more)`;
      return;
    }
    const text = this.line(
      cause ? `for your ${cause.asked}, ${sentence(record)}` : sentence(record),
      cause ? 'mine' : '',
      record.world,
    );
    if (!cause) this.last[record.world] = { world: record.world, at: now, record, more: 0, text };
  }

  said(text: string): void {
    this.line(text, 'event');
  }

  private line(text: string, kind: string, world = -1): HTMLElement {
    const words = h('span', {}, text);
    const dot = world >= 0 ? h('span', { class: 'dot', style: `background:${css(worldColour(world))}` }) : null;
    const line = h('div', { class: `line ${kind}` }, dot, words);
    this.root.append(line);
    setTimeout(() => line.remove(), 1000 * stays);
    while (this.root.children.length > lines) this.root.firstChild!.remove();
    return words;
  }
}

const sentence = (r: RollbackRecord) =>
  `world ${r.world} did ${plural(r.steps, 'step')} again from step ${count(r.step)}: ${plural(r.bodies, 'body', 'bodies')}, ${digits(r.milliseconds, 2)} ms`;
