// Values over the last seconds, for small plots.
export interface Ticks {
  readonly seconds: number;
  readonly at: number[];
  readonly value: number[];
  add(at: number, value: number): void;
}

export function newTicks(seconds: number): Ticks {
  const at: number[] = [];
  const value: number[] = [];
  return {
    seconds,
    at,
    value,
    add(time: number, v: number) {
      at.push(time);
      value.push(Number.isFinite(v) ? v : 0);
      while (at.length > 2 && time - at[1]! > seconds) {
        at.shift();
        value.shift();
      }
    },
  };
}
