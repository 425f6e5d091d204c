// A small plot of the last minute.
import type { Ticks } from '../model/ticks';
import { sharpContext } from './dom';

export interface SparkStyle {
  colour: string;
  least: number; // the scale reaches at least that far
}

export function drawSpark(canvas: HTMLCanvasElement, ticks: Ticks, now: number, style: SparkStyle): void {
  const width = canvas.clientWidth;
  const height = canvas.clientHeight;
  if (width === 0) return;
  const context = sharpContext(canvas, width, height);
  let most = style.least;
  for (const v of ticks.value) most = Math.max(most, v);
  const x = (at: number) => width * (1 - (now - at) / ticks.seconds);
  const y = (v: number) => height - 1.5 - (height - 13) * (Math.max(0, v) / most); // the name stands above
  context.strokeStyle = style.colour;
  context.globalAlpha = 0.18;
  context.beginPath();
  context.moveTo(0, height - 0.5);
  context.lineTo(width, height - 0.5);
  context.stroke();
  if (ticks.at.length < 2) return;
  context.beginPath();
  context.moveTo(x(ticks.at[0]!), height);
  ticks.at.forEach((at, k) => context.lineTo(x(at), y(ticks.value[k]!)));
  context.lineTo(x(ticks.at[ticks.at.length - 1]!), height);
  context.closePath();
  context.fillStyle = style.colour;
  context.fill();
  context.globalAlpha = 1;
  context.beginPath();
  ticks.at.forEach((at, k) => (k ? context.lineTo(x(at), y(ticks.value[k]!)) : context.moveTo(x(at), y(ticks.value[k]!))));
  context.lineWidth = 1.4;
  context.lineJoin = 'round';
  context.stroke();
}
