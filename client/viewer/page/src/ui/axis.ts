// From steps to pixels. A session: the displayed step stands still in the picture, and past and future stream by; the
// future, which is short, has the larger part. A recording: from its first step to its last.

export class Axis {
  private past = 60; // steps shown to the left
  private future = 32;
  private at = 0; // displayed step
  private whole: [number, number] | null = null;
  width = 100;
  readonly share = 0.44; // of the width that is past

  live(displayed: number, oldest: number, newest: number): void {
    this.whole = null;
    this.at = displayed;
    this.past = glide(this.past, Math.max(30, displayed - oldest));
    this.future = glide(this.future, Math.max(16, newest - displayed));
  }

  recording(first: number, last: number): void {
    this.whole = [first, Math.max(first + 1, last)];
  }

  x(step: number): number {
    if (this.whole) return (this.width * (step - this.whole[0])) / (this.whole[1] - this.whole[0]);
    const middle = this.share * this.width;
    const away = step - this.at;
    return away < 0 ? middle * (1 + away / this.past) : middle + (this.width - middle) * (away / this.future);
  }

  step(x: number): number {
    if (this.whole) return this.whole[0] + (x / this.width) * (this.whole[1] - this.whole[0]);
    const middle = this.share * this.width;
    return x < middle
      ? this.at + (x / middle - 1) * this.past
      : this.at + ((x - middle) / (this.width - middle)) * this.future;
  }

  // Steps to write numbers at: round ones, not closer than some pixels.
  ticks(): number[] {
    const found: number[] = [];
    const parts: [number, number][] = this.whole
      ? [this.whole]
      : [
          [this.at - this.past, this.at],
          [this.at, this.at + this.future],
        ];
    for (const [low, high] of parts) {
      const pixels = Math.abs(this.x(high) - this.x(low));
      const apart = roundUp(((high - low) * 80) / Math.max(1, pixels));
      for (let s = Math.max(0, Math.ceil(low / apart) * apart); s <= high; s += apart) found.push(s);
    }
    return found;
  }
}

// The scale grows at once and shrinks slowly, in steps, so that it does not breathe with each message.
function glide(now: number, wanted: number): number {
  const room = 8 * Math.ceil((wanted * 1.08) / 8);
  return room > now ? room : room < 0.7 * now ? now - 8 * Math.ceil((now - room) / 64) : now;
}

function roundUp(least: number): number {
  const power = 10 ** Math.floor(Math.log10(Math.max(1, least)));
  for (const factor of [1, 2, 5, 10]) if (factor * power >= least) return factor * power;
  return 10 * power;
}
