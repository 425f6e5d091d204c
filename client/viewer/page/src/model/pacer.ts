// How fast frames come, and where between them the picture should be: a little behind the newest, by as much as frames
// are apart and their arrivals scatter, so that there is always a next one to move towards.

const keep = 24; // arrivals looked at
const forget = 0.7; // s

export class Pacer {
  private times: number[] = [];
  private steps: number[] = [];
  private offset = 0; // of the fitted line at time 0 of `origin`
  private origin = 0;
  rate = 0; // steps per second
  interval = 1 / 60; // s between frames
  spread = 0; // s, how far arrivals are off the line

  constructor(private usual: number) {} // steps per second until more is known

  expect(usual: number): void {
    if (usual > 0) this.usual = usual;
  }

  restart(): void {
    this.times.length = this.steps.length = 0;
    this.rate = 0;
  }

  arrived(now: number, step: number): void {
    const last = this.times[this.times.length - 1];
    // After a pause the old arrivals say nothing about the speed.
    if (last !== undefined && now - last > Math.max(0.4, 4 * this.interval)) this.restart();
    this.times.push(now);
    this.steps.push(step);
    while (this.times.length > keep || (this.times.length > 4 && now - this.times[0]! > forget)) {
      this.times.shift();
      this.steps.shift();
    }
    this.fit();
  }

  // Steps that the picture should be at.
  target(now: number): number {
    return this.offset + this.speed() * (now - this.origin - this.delay());
  }

  speed(): number {
    return this.rate > 0 ? this.rate : this.usual;
  }

  delay(): number {
    return Math.min(0.3, Math.max(0.012, 1.2 * this.interval + 2 * this.spread));
  }

  // Steps between two frames.
  stride(): number {
    return Math.max(1, this.speed() * this.interval);
  }

  // Least squares: step = offset + rate * (time - origin).
  private fit(): void {
    const n = this.times.length;
    const last = n - 1;
    this.origin = this.times[last]!;
    if (n < 3) {
      this.rate = 0;
      this.offset = this.steps[last]!;
      return;
    }
    let meanT = 0;
    let meanS = 0;
    for (let k = 0; k < n; k++) {
      meanT += this.times[k]! - this.origin;
      meanS += this.steps[k]!;
    }
    meanT /= n;
    meanS /= n;
    let tt = 0;
    let ts = 0;
    for (let k = 0; k < n; k++) {
      const t = this.times[k]! - this.origin - meanT;
      tt += t * t;
      ts += t * (this.steps[k]! - meanS);
    }
    this.rate = tt > 0 ? Math.max(0, ts / tt) : 0;
    this.offset = meanS - this.rate * meanT;
    this.interval = (this.times[last]! - this.times[0]!) / last;
    if (this.rate > 0) {
      let off = 0;
      for (let k = 0; k < n; k++) {
        const line = this.offset + this.rate * (this.times[k]! - this.origin);
        off += ((this.steps[k]! - line) / this.rate) ** 2;
      }
      this.spread = Math.sqrt(off / n);
    }
  }
}
