// The picture of the timeline: for each world what is final (solid), what is computed and whole (lighter), and what it
// has run ahead to (hatched).
import { css, worldColour } from '../draw/colours';
import type { Session } from '../model/session';
import type { Axis } from './axis';
import { sharpContext } from './dom';

const top = 16; // pixels for the numbers
const gutter = 2;

export const rowHeight = (worlds: number) => (worlds <= 8 ? 12 : worlds <= 16 ? 7 : worlds <= 32 ? 5 : 3);
export const barsHeight = (worlds: number) => top + Math.max(1, worlds) * rowHeight(worlds) + 3;

export interface BarColours {
  text: string;
  line: string;
  track: string;
  bad: string;
}

let hatches = new Map<string, CanvasPattern>();

// Thin slanted strokes, 6 pixels apart.
function hatch(context: CanvasRenderingContext2D, colour: string): CanvasPattern {
  let found = hatches.get(colour);
  if (!found) {
    if (hatches.size > 200) hatches = new Map();
    const tile = document.createElement('canvas');
    tile.width = tile.height = 6;
    const pen = tile.getContext('2d')!;
    pen.strokeStyle = colour;
    pen.lineWidth = 1.5;
    for (const off of [-6, 0, 6]) {
      pen.beginPath();
      pen.moveTo(off - 1, 7);
      pen.lineTo(off + 7, -1);
      pen.stroke();
    }
    found = context.createPattern(tile, 'repeat')!;
    hatches.set(colour, found);
  }
  return found;
}

export function drawBars(
  canvas: HTMLCanvasElement,
  session: Session,
  axis: Axis,
  colours: BarColours,
  bad: (world: number) => boolean,
): void {
  const width = canvas.clientWidth;
  const height = canvas.clientHeight;
  if (width === 0) return;
  axis.width = width;
  const context = sharpContext(canvas, width, height);
  const worlds = Math.max(1, session.rows.length);
  const row = rowHeight(worlds);
  const within = (x: number) => Math.min(width, Math.max(0, x));

  context.font = '10px system-ui, sans-serif';
  context.textBaseline = 'middle';
  context.fillStyle = colours.text;
  context.strokeStyle = colours.line;
  context.lineWidth = 1;
  let written = -Infinity; // up to where
  for (const step of axis.ticks()) {
    const x = Math.round(axis.x(step)) + 0.5;
    context.beginPath();
    context.moveTo(x, top - 3);
    context.lineTo(x, height);
    context.stroke();
    const label = step.toLocaleString('en');
    const half = context.measureText(label).width / 2;
    if (x - half < Math.max(0, written + 8) || x + half > width) continue;
    context.fillText(label, x - half, 7);
    written = x + half;
  }

  const box = (from: number, to: number, y: number, fill: string | CanvasPattern) => {
    const a = within(axis.x(from));
    const b = within(axis.x(to));
    if (b - a < 0.5) return;
    context.fillStyle = fill;
    context.fillRect(a, y, b - a, row - gutter);
  };
  for (let w = 0; w < worlds; w++) {
    const y = top + w * row;
    const rgb = worldColour(w);
    context.fillStyle = colours.track;
    context.fillRect(0, y, width, row - gutter);
    const clocks = session.rows[w];
    if (!clocks) {
      // A recording has no worlds: what is behind and what is to come.
      box(session.oldest, session.displayed, y, css(rgb, 0.95));
      box(session.displayed, session.newest, y, css(rgb, 0.3));
      continue;
    }
    const { clock, front, final } = clocks;
    const ahead = Math.max(front, final);
    box(session.oldest, final, y, css(rgb, 0.95));
    box(final, ahead, y, css(rgb, 0.42));
    box(final, ahead, y, hatch(context, css(rgb, 0.5)));
    box(ahead, clock, y, hatch(context, css(rgb, 0.55)));
    if (bad(w)) {
      context.strokeStyle = colours.bad;
      context.lineWidth = 2;
      context.strokeRect(1, y, width - 2, row - gutter);
      context.lineWidth = 1;
    }
  }
  // What can be shown ends here.
  context.fillStyle = colours.text;
  for (const end of [session.oldest, session.newest]) {
    const x = axis.x(end);
    if (x > 0 && x < width) context.fillRect(Math.round(x) - 0.5, top - 4, 1, height);
  }
}
