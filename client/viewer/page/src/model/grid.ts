// The territory grid: which world owns which cell at the step that is shown, and where its borders are.
import type { Grid as GridMessage, Transfer as TransferMessage } from '../gen/viewer_pb';

// Cells that are the taker's from a step on.
interface Transfer {
  step: number;
  taker: number;
  cells: number[];
}

export interface BorderFace {
  axis: 0 | 1 | 2;
  at: number; // m along the axis
  low: [number, number]; // m along the other two, in the order of the axes
  high: [number, number];
  below: number; // owner on the lower side
  above: number;
}

export class Grid {
  readonly origin: readonly [number, number, number];
  readonly edge: number;
  readonly size: readonly [number, number, number];
  readonly owner: Uint16Array; // at the step of goTo()
  private readonly initial: Uint16Array;
  private readonly transfers: Transfer[] = []; // by step
  private done = 0; // how many of them `owner` has
  private stale = false; // some of a step that is shown have become known only since

  constructor(message: GridMessage | undefined) {
    const at = (k: number) => message?.origin[k] ?? 0;
    const cells = (k: number) => Math.max(0, message?.size[k] ?? 0);
    this.origin = [at(0), at(1), at(2)];
    this.edge = message?.edge ?? 1;
    this.size = [cells(0), cells(1), cells(2)];
    const bytes = message?.owner ?? new Uint8Array(0);
    this.owner = new Uint16Array(bytes.slice().buffer as ArrayBuffer, 0, bytes.length >> 1);
    if (this.owner.length < this.size[0] * this.size[1] * this.size[2]) this.size = [0, 0, 0];
    this.initial = this.owner.slice();
  }

  // Transfers that have become known, in any order; seen with the next goTo().
  add(list: TransferMessage[]): void {
    for (const { step, taker, cell } of list) {
      const transfer = { step: Number(step), taker, cells: cell.filter((c) => c < this.owner.length) };
      let at = this.transfers.length; // mostly the newest
      while (at > 0 && this.transfers[at - 1]!.step > transfer.step) at--;
      this.transfers.splice(at, 0, transfer);
      if (at < this.done) this.stale = true;
    }
  }

  // Makes `owner` that of this step, whether later or earlier than the one before; says whether that is another.
  goTo(step: number): boolean {
    const before = this.done;
    const { stale } = this;
    if (stale || (this.done > 0 && this.transfers[this.done - 1]!.step > step)) {
      this.owner.set(this.initial);
      this.done = 0;
      this.stale = false;
    }
    for (; this.done < this.transfers.length && this.transfers[this.done]!.step <= step; this.done++) {
      const { taker, cells } = this.transfers[this.done]!;
      for (const cell of cells) this.owner[cell] = taker;
    }
    return stale || this.done !== before;
  }

  // How many cells each world owns.
  cells(worlds: number): number[] {
    const counts = new Array<number>(worlds).fill(0);
    for (const w of this.owner) if (w < worlds) counts[w]!++;
    return counts;
  }

  ownerAt(x: number, y: number, z: number): number {
    return this.owner[x + this.size[0] * (y + this.size[1] * z)]!;
  }

  // Mean of each world's cells: where its name is written. Undefined where it owns none.
  centres(worlds: number): ([number, number, number] | undefined)[] {
    const sums: (([number, number, number] | undefined))[] = new Array(worlds);
    const counts = new Array<number>(worlds).fill(0);
    const [nx, ny, nz] = this.size;
    for (let z = 0; z < nz; z++)
      for (let y = 0; y < ny; y++)
        for (let x = 0; x < nx; x++) {
          const w = this.ownerAt(x, y, z);
          if (w >= worlds) continue;
          const sum = (sums[w] ??= [0, 0, 0]);
          sum[0] += x + 0.5;
          sum[1] += y + 0.5;
          sum[2] += z + 0.5;
          counts[w]!++;
        }
    return sums.map((sum, w) => sum && (sum.map((s, c) => this.origin[c]! + (this.edge * s) / counts[w]!) as [number, number, number]));
  }

  // Faces between cells of different owners. Those in one plane with the same two owners are put together into
  // rectangles: a straight border through a hundred thousand cells is one of them.
  faces(): BorderFace[] {
    const found: BorderFace[] = [];
    for (const axis of [0, 1, 2] as const) {
      const [u, v] = axis === 0 ? [1, 2] : axis === 1 ? [0, 2] : [0, 1];
      const nu = this.size[u]!;
      const nv = this.size[v]!;
      const cell: [number, number, number] = [0, 0, 0];
      const pairs = new Int32Array(nu * nv); // below * 65536 + above, or -1
      for (let plane = 1; plane < this.size[axis]; plane++) {
        for (let b = 0; b < nv; b++)
          for (let a = 0; a < nu; a++) {
            cell[u] = a;
            cell[v] = b;
            cell[axis] = plane - 1;
            const below = this.ownerAt(...cell);
            cell[axis] = plane;
            const above = this.ownerAt(...cell);
            pairs[a + nu * b] = below === above ? -1 : (below << 16) | above;
          }
        for (const [a0, b0, a1, b1, pair] of rectangles(pairs, nu, nv))
          found.push({
            axis,
            at: this.origin[axis] + plane * this.edge,
            low: [this.origin[u]! + a0 * this.edge, this.origin[v]! + b0 * this.edge],
            high: [this.origin[u]! + a1 * this.edge, this.origin[v]! + b1 * this.edge],
            below: pair >>> 16,
            above: pair & 0xffff,
          });
      }
    }
    return found;
  }
}

// Covers equal values that are not -1 with rectangles, as wide and then as high as they go; clears `values`.
function rectangles(values: Int32Array, nu: number, nv: number): [number, number, number, number, number][] {
  const found: [number, number, number, number, number][] = [];
  for (let b = 0; b < nv; b++)
    for (let a = 0; a < nu; a++) {
      const value = values[a + nu * b]!;
      if (value === -1) continue;
      let right = a + 1;
      while (right < nu && values[right + nu * b] === value) right++;
      let top = b + 1;
      const rowIs = (row: number) => {
        for (let k = a; k < right; k++) if (values[k + nu * row] !== value) return false;
        return true;
      };
      while (top < nv && rowIs(top)) top++;
      for (let row = b; row < top; row++) values.fill(-1, a + nu * row, right + nu * row);
      found.push([a, b, right, top, value]);
    }
  return found;
}
