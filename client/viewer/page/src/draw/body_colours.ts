// Which colour a body has, by what the user wants to see.
import { FrameFlag } from '../gen/viewer_pb';
import type { Bodies } from '../model/bodies';
import type { Settings } from '../settings';
import { asleepColour, awakeColour, hashColour, mixedColour, nearColour, speedIndex, speedTable, worldColour } from './colours';

// Between two colours, each channel by itself.
function mix(a: number, b: number, share: number): number {
  const part = (shift: number) => {
    const x = (a >> shift) & 255;
    return Math.round(x + share * (((b >> shift) & 255) - x)) << shift;
  };
  return part(16) | part(8) | part(0);
}

const muted = 0x969ca6; // of bodies that are not meant, while others are pointed out
const shining = 0xb0 << 24;

export class BodyColours {
  private own = new Int32Array(0); // by body; -1: not asked for yet
  private ownFor: boolean | null = null;
  private ownIds: bigint[] | null = null; // of which scene

  // Speed at the top of the ramp, m/s: as the user has set it, or by the bodies.
  private measured = 5;

  constructor(
    private readonly bodies: Bodies,
    private readonly settings: Settings,
  ) {}

  get topSpeed(): number {
    return this.settings.speedScale || this.measured;
  }

  // Looks at the speeds of now; whether the top of the ramp has changed. Where nothing moves it stays.
  measure(): boolean {
    const { present, speed, count } = this.bodies;
    const speeds: number[] = [];
    for (let i = 0; i < count; i++) if (present[i] && speed[i]! > 0.05) speeds.push(speed[i]!);
    if (speeds.length === 0) return false;
    speeds.sort((a, b) => a - b);
    const fast = speeds[Math.floor(0.95 * (speeds.length - 1))]!;
    // Up when it is passed, down when a much smaller one would do: the colours should not flicker.
    if (fast <= this.measured && fast > 0.35 * this.measured) return false;
    const power = 10 ** Math.floor(Math.log10(fast));
    const wanted = power * [1, 2, 5, 10].find((f) => f * power >= fast)!;
    const changed = wanted !== this.measured;
    this.measured = wanted;
    return changed;
  }

  // 0xAARRGGBB: alpha is how much the body shines.
  of(body: number): number {
    const flags = this.bodies.flags[body]!;
    let colour = this.base(body, flags);
    const { near, mixed } = this.settings;
    if (near || mixed) {
      if (mixed && flags & FrameFlag.FLAG_MIXED) colour = mix(colour, mixedColour, 0.85) | shining;
      else if (near && flags & FrameFlag.FLAG_NEAR) colour = mix(colour, nearColour, 0.85) | shining;
      else colour = mix(colour, muted, 0.72);
    }
    return colour;
  }

  private base(body: number, flags: number): number {
    switch (this.settings.colour) {
      case 'world':
        return worldColour(this.bodies.world[body]!);
      case 'speed':
        return flags & FrameFlag.FLAG_ASLEEP
          ? speedTable[0]!
          : speedTable[speedIndex(this.bodies.speed[body]!, this.topSpeed)]!;
      case 'sleep':
        return flags & FrameFlag.FLAG_ASLEEP ? asleepColour : awakeColour;
      case 'body':
        return this.ownColour(body);
    }
  }

  private ownColour(body: number): number {
    const { oneColour, colour, ids } = this.bodies;
    if (this.own.length < this.bodies.mesh.length || this.ownFor !== oneColour || this.ownIds !== ids) {
      this.own = new Int32Array(this.bodies.mesh.length).fill(-1);
      this.ownFor = oneColour;
      this.ownIds = ids;
    }
    const known = this.own[body]!;
    if (known >= 0) return known;
    return (this.own[body] = oneColour ? hashColour(ids[body]!) : colour[body]! >>> 8);
  }
}
