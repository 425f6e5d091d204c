// The two themes as the 3D view has them. The page's own colours are in style/base.css.
export interface Look {
  zenith: number;
  horizon: number; // and fog
  nadir: number;
  sky: number; // light from above
  ground: number; // light from below
  ambient: number; // strength of both
  sun: number;
  sunlight: number; // strength
  lines: number; // on floors
  lineStrength: number;
  tint: number; // of the ground by its owner
  exposure: number;
}

export const looks: Record<'dark' | 'light', Look> = {
  dark: {
    zenith: 0x0a0f18,
    horizon: 0x1d2735,
    nadir: 0x0b0f15,
    sky: 0x9db8dc,
    ground: 0x5a5048,
    ambient: 1.6,
    sun: 0xffead0,
    sunlight: 2.4,
    lines: 0x9fb4d0,
    lineStrength: 0.22,
    tint: 0.42,
    exposure: 0.92,
  },
  light: {
    zenith: 0x8fb6df,
    horizon: 0xe6edf4,
    nadir: 0xc9d2db,
    sky: 0xdfeeff,
    ground: 0x9b8f80,
    ambient: 1.75,
    sun: 0xfff1dc,
    sunlight: 2.9,
    lines: 0x2b3a4d,
    lineStrength: 0.2,
    tint: 0.45,
    exposure: 1.02,
  },
};

export type LevelName = 'high' | 'medium' | 'low' | 'minimal';

export interface Level {
  pixelRatio: number;
  shadows: number; // edge of the shadow map, 0: none
  softShadows: boolean;
  fine: boolean; // highlights on bodies
  occlusion: boolean;
}

export const levels: Record<LevelName, Level> = {
  high: { pixelRatio: 2, shadows: 4096, softShadows: true, fine: true, occlusion: true },
  medium: { pixelRatio: 1.5, shadows: 2048, softShadows: true, fine: true, occlusion: false },
  low: { pixelRatio: 1, shadows: 1024, softShadows: false, fine: false, occlusion: false },
  minimal: { pixelRatio: 0.75, shadows: 0, softShadows: false, fine: false, occlusion: false },
};
