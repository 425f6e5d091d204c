// Which step the user wants to see, and telling the gateway of it, not more often than it could send frames.
import { create } from '@bufbuild/protobuf';
import { LookSchema, type FromPage, type Look } from '../gen/viewer_pb';
import { throttled } from '../throttle';

const perSecond = 30;

export class Looking {
  offset = 0; // steps from the displayed one
  held: number | null = null; // always this step, rather than the offset
  private readonly send: (which: Look['which']) => void;

  constructor(
    send: (what: FromPage['what']) => void,
    private readonly changed: () => void,
  ) {
    this.send = throttled((which) => send({ case: 'look', value: create(LookSchema, { which }) }), 1000 / perSecond);
  }

  get live(): boolean {
    return this.held === null && this.offset === 0;
  }

  // Steps from the displayed one.
  difference(displayed: number): number {
    return this.held !== null ? this.held - displayed : this.offset;
  }

  at(offset: number): void {
    this.offset = Math.round(offset);
    this.held = null;
    this.tell();
  }

  hold(step: number): void {
    this.held = Math.round(step);
    this.tell();
  }

  // After a connection was made anew: the gateway starts live.
  again(): void {
    if (!this.live) this.tell();
  }

  private tell(): void {
    this.changed();
    this.send(
      this.held !== null ? { case: 'step', value: BigInt(this.held) } : { case: 'offset', value: BigInt(this.offset) },
    );
  }
}
