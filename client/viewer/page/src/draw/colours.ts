// Colours as 0xRRGGBB (sRGB). They are made in OKLCH, where equal numbers look equally light and equally strong, so that
// no body stands out that should not: see Björn Ottosson, "A perceptual color space for image processing" (2020), whose
// matrices are used below.

export type Rgb = number;

const clamp01 = (x: number) => Math.min(1, Math.max(0, x));
const encode = (x: number) => (x <= 0.0031308 ? 12.92 * x : 1.055 * x ** (1 / 2.4) - 0.055);

// Lightness 0 .. 1, chroma 0 .. 0.4, hue in degrees.
export function oklch(lightness: number, chroma: number, hue: number): Rgb {
  const a = chroma * Math.cos((hue * Math.PI) / 180);
  const b = chroma * Math.sin((hue * Math.PI) / 180);
  const l = (lightness + 0.3963377774 * a + 0.2158037573 * b) ** 3;
  const m = (lightness - 0.1055613458 * a - 0.0638541728 * b) ** 3;
  const s = (lightness - 0.0894841775 * a - 1.291485548 * b) ** 3;
  const red = 4.0767416621 * l - 3.3077115913 * m + 0.2309699292 * s;
  const green = -1.2684380046 * l + 2.6097574011 * m - 0.3413193965 * s;
  const blue = -0.0041960863 * l - 0.7034186147 * m + 1.707614701 * s;
  const byte = (x: number) => Math.round(255 * clamp01(encode(clamp01(x))));
  return (byte(red) << 16) | (byte(green) << 8) | byte(blue);
}

export const css = (rgb: Rgb, alpha = 1) =>
  alpha === 1
    ? `#${rgb.toString(16).padStart(6, '0')}`
    : `rgba(${rgb >> 16}, ${(rgb >> 8) & 255}, ${rgb & 255}, ${alpha})`;

// Hues that people tell apart, neighbours far from each other. Plain red is not among them: it means trouble.
const worldHues = [252, 62, 158, 318, 100, 212, 348, 130, 285, 40];
const worlds: Rgb[] = [];

export function worldColour(world: number): Rgb {
  let found = worlds[world];
  if (found === undefined) {
    const turn = Math.floor(world / worldHues.length);
    const hue = worldHues[world % worldHues.length]! + turn * 13;
    found = oklch([0.7, 0.58, 0.81][turn % 3]!, [0.145, 0.12, 0.1][turn % 3]!, hue);
    worlds[world] = found;
  }
  return found;
}

// For scenes whose bodies all have one colour: different ones, calm, and always the same for a body. A few families of
// hues rather than all of them, so that a thousand bodies do not look like confetti.
const bodyHues = [38, 62, 84, 150, 195, 232, 255, 20];

export function hashColour(id: bigint): Rgb {
  let h = Number(BigInt.asUintN(32, id * 0x9e3779b97f4a7c15n >> 13n));
  h ^= h >>> 15;
  h = Math.imul(h, 0x2c1b3c6d) >>> 0;
  h ^= h >>> 12;
  const hue = bodyHues[h % bodyHues.length]! + ((h >>> 8) % 13) - 6;
  const lightness = 0.62 + (((h >>> 12) % 100) / 100) * 0.2;
  const chroma = 0.055 + (((h >>> 19) % 100) / 100) * 0.055;
  return oklch(lightness, chroma, hue);
}

// From rest (deep blue) to fast (bright yellow); lightness only ever grows, so the order is seen without the hue, too.
export function speedRamp(share: number): Rgb {
  const x = clamp01(share);
  return oklch(0.34 + 0.56 * x, 0.11 + 0.07 * Math.sin(Math.PI * x), 282 - 190 * x ** 1.15);
}

export const asleepColour = oklch(0.55, 0.025, 255);
export const awakeColour = oklch(0.76, 0.14, 62);
export const nearColour = oklch(0.82, 0.13, 200);
export const mixedColour = oklch(0.68, 0.21, 340);
export const redoneColour = oklch(0.78, 0.17, 65);
export const accentColour = oklch(0.72, 0.15, 240);

// A table of the ramp, for colouring thousands of bodies at each frame. Speeds are shown on a scale of roots, so that
// slow motion is told from rest in a scene with one fast body.
export const speedSteps = 256;
export const speedTable: Uint32Array = Uint32Array.from({ length: speedSteps }, (_, i) =>
  speedRamp(i / (speedSteps - 1)),
);
export const speedIndex = (speed: number, most: number) =>
  Math.min(speedSteps - 1, Math.floor(Math.sqrt(clamp01(speed / most)) * speedSteps));
