// Which step the user wants to see, and telling the gateway of it, not more often than it could send frames.
import { create } from '@bufbuild/protobuf';
import { LookSchema, type FromPage } from '../gen/viewer_pb';

const perSecond = 30;

export class Looking {
  offset = 0; // steps from the displayed one
  held: number | null = null; // always this step, rather than the offset
  private timer = 0;
  private sentAt = 0;

  constructor(
    private readonly send: (what: FromPage['what']) => void,
    private readonly changed: () => void,
  ) {}

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

  reset(): void {
    this.offset = 0;
    this.held = null;
    this.changed();
  }

  private tell(): void {
    this.changed();
    clearTimeout(this.timer);
    const wait = this.sentAt + 1000 / perSecond - performance.now();
    if (wait > 0) {
      this.timer = window.setTimeout(() => this.tell(), wait);
      return;
    }
    this.sentAt = performance.now();
    this.send({
      case: 'look',
      value: create(LookSchema, {
        which:
          this.held !== null
            ? { case: 'step', value: BigInt(this.held) }
            : { case: 'offset', value: BigInt(this.offset) },
      }),
    });
  }
}
