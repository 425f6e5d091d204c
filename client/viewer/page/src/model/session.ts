// What the gateway has told, and who wants to know of it. Nothing here draws.
import { newTicks, type Ticks } from './ticks';
import type { BodyList, Clocks, Ended, Frame, Rollback, ToPage, Transfer, Welcome, WorldState } from '../gen/viewer_pb';

// Gateway and page are of one build; a page that a browser kept from another one says so instead of misreading.
export const protocol = 3;

export interface RollbackRecord {
  world: number;
  step: number;
  steps: number;
  bodies: number;
  milliseconds: number;
  at: number; // s, performance time
}

export interface WorldRow {
  clock: number;
  front: number;
  final: number;
  silent: boolean;
}

const keep = 500; // rollbacks
export const plotSeconds = 60;

// One value per telling of Worlds, for the plots.
export interface WorldHistory {
  load: Ticks;
  lead: Ticks;
  rollbacks: Ticks; // bodies redone per second
}

export interface SessionEvents {
  welcome(welcome: Welcome): void;
  bodies(list: BodyList): void;
  transfers(list: Transfer[]): void;
  frame(frame: Frame): void;
  clocks(): void;
  worlds(): void;
  rollback(record: RollbackRecord): void;
  ended(ended: Ended): void;
  said(text: string): void;
}

export class Session {
  welcome: Welcome | null = null;
  clocks: Clocks | null = null;
  worlds: WorldState[] = [];
  rows: WorldRow[] = [];
  history: WorldHistory[] = [];
  ended: Ended | null = null;
  readonly rollbacks: RollbackRecord[] = [];
  displayed = 0;
  oldest = 0;
  newest = 0;
  final = 0;
  private seenRedone: number[] = [];
  private seenAt: number[] = [];

  constructor(private readonly events: SessionEvents) {}

  get mayAct(): boolean {
    return !!this.welcome?.mayAct && !this.welcome.replay && !this.ended;
  }

  // Pausing and speed.
  get mayPace(): boolean {
    return !!this.welcome?.mayAct && !this.ended;
  }

  take(message: ToPage, now: number): void {
    const what = message.what;
    switch (what.case) {
      case 'welcome':
        this.begin(what.value);
        break;
      case 'bodies':
        this.events.bodies(what.value);
        break;
      case 'transfers':
        this.events.transfers(what.value.transfer);
        break;
      case 'frame':
        this.events.frame(what.value);
        break;
      case 'clocks':
        this.takeClocks(what.value);
        break;
      case 'worlds':
        this.takeWorlds(what.value.world, now);
        break;
      case 'rollback':
        this.takeRollback(what.value, now);
        break;
      case 'ended':
        this.ended = what.value;
        this.events.ended(what.value);
        break;
      case 'events':
        for (const text of what.value.text) this.events.said(text);
        break;
      case 'answer': // main.ts gives it to Requests
      case undefined:
        break;
    }
  }

  // Worlds whose final step is far behind the others' hold all of them up.
  behind(world: number): number {
    const row = this.rows[world];
    if (!row || this.rows.length < 2) return 0;
    let best = -Infinity;
    for (const other of this.rows) best = Math.max(best, other.final);
    const by = best - row.final;
    return by >= Math.max(8, (this.welcome?.window ?? 48) / 4) ? by : 0;
  }

  private begin(welcome: Welcome): void {
    this.welcome = welcome;
    this.clocks = null;
    this.worlds = [];
    this.rows = [];
    this.history = [];
    this.ended = null;
    this.seenRedone = [];
    this.seenAt = [];
    this.events.welcome(welcome);
  }

  private takeClocks(clocks: Clocks): void {
    this.clocks = clocks;
    this.displayed = Number(clocks.displayed);
    this.oldest = Number(clocks.oldest);
    this.newest = Number(clocks.newest);
    this.final = Number(clocks.final);
    this.rows = clocks.world.map((w) => ({
      clock: Number(w.clock),
      front: Number(w.front),
      final: Number(w.final),
      silent: w.silent,
    }));
    this.events.clocks();
  }

  private takeWorlds(worlds: WorldState[], now: number): void {
    this.worlds = worlds;
    worlds.forEach((state, w) => {
      this.history[w] ??= {
        load: newTicks(plotSeconds),
        lead: newTicks(plotSeconds),
        rollbacks: newTicks(plotSeconds),
      };
      const redone = Number(state.bodiesRedone);
      const passed = now - (this.seenAt[w] ?? now);
      const rate = passed > 0 ? Math.max(0, redone - this.seenRedone[w]!) / passed : 0;
      this.seenRedone[w] = redone;
      this.seenAt[w] = now;
      this.history[w].load.add(now, state.load);
      this.history[w].lead.add(now, Number(state.lead));
      this.history[w].rollbacks.add(now, rate);
    });
    this.events.worlds();
  }

  private takeRollback(rollback: Rollback, now: number): void {
    const record: RollbackRecord = {
      world: rollback.world,
      step: Number(rollback.step),
      steps: rollback.steps,
      bodies: Number(rollback.bodies),
      milliseconds: rollback.milliseconds,
      at: now,
    };
    this.rollbacks.push(record);
    if (this.rollbacks.length > keep) this.rollbacks.shift();
    this.events.rollback(record);
  }
}
