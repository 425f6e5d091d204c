// Small helpers for building the page without a framework.

type Props = Record<string, string | number | boolean | EventListener | undefined>;

// An element with attributes (or listeners: on...), and children.
export function h<K extends keyof HTMLElementTagNameMap>(
  tag: K,
  props: Props = {},
  ...children: (Node | string | null)[]
): HTMLElementTagNameMap[K] {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(props)) {
    if (value === undefined || value === false) continue;
    if (typeof value === 'function') element.addEventListener(name.slice(2), value);
    else if (name === 'style') element.style.cssText = String(value); // the attribute would be forbidden as written in line
    else element.setAttribute(name, value === true ? '' : String(value));
  }
  for (const child of children) if (child !== null) element.append(child);
  return element;
}

export function byId<T extends HTMLElement = HTMLElement>(id: string): T {
  const found = document.getElementById(id);
  if (!found) throw new Error(`soda: the page has no #${id}`);
  return found as T;
}

// Strokes on a field of 24 x 24.
const icons = {
  select: 'M5 3l14 8-6 2-3 6z',
  grab: 'M12 21v-6M12 15a4 4 0 1 0 0-8 4 4 0 0 0 0 8zM12 3v1M4.5 7.5l1 .6M19.5 7.5l-1 .6',
  push: 'M3 12h11M10 7l5 5-5 5M19 5v14',
  spawn: 'M4 8l8-4 8 4v8l-8 4-8-4zM12 9v6M9 12h6',
  remove: 'M5 7h14M10 7V4h4v3M7 7l1 13h8l1-13M10 11v5M14 11v5',
  borders: 'M4 4h16v16H4zM12 4v16M4 12h8M12 9h8',
  near: 'M12 3v18M7 8a4 4 0 0 0 0 8M17 8a4 4 0 0 1 0 8',
  mixed: 'M9 15a5 5 0 1 1 0-6M15 9a5 5 0 1 1 0 6M9 9l6 6M15 9l-6 6',
  redone: 'M4 12a8 8 0 1 1 3 6.2M4 19v-5h5',
  follow: 'M12 15a3 3 0 1 0 0-6 3 3 0 0 0 0 6zM12 2v5M12 17v5M2 12h5M17 12h5',
  home: 'M4 9V4h5M20 9V4h-5M4 15v5h5M20 15v5h-5M9 9h6v6H9z',
  pause: 'M8 5v14M16 5v14',
  play: 'M7 4.5l12 7.5-12 7.5z',
  step: 'M6 5l9 7-9 7zM19 5v14',
  live: 'M12 14a2 2 0 1 0 0-4 2 2 0 0 0 0 4zM7.5 7.5a6.4 6.4 0 0 0 0 9M16.5 7.5a6.4 6.4 0 0 1 0 9M4.5 4.5a10.6 10.6 0 0 0 0 15M19.5 4.5a10.6 10.6 0 0 1 0 15',
  hold: 'M6 10h12v10H6zM9 10V7a3 3 0 0 1 6 0v3',
  sun: 'M12 16a4 4 0 1 0 0-8 4 4 0 0 0 0 8zM12 2v3M12 19v3M2 12h3M19 12h3M5 5l2 2M17 17l2 2M5 19l2-2M17 7l2-2',
  moon: 'M20 14.5A8.5 8.5 0 0 1 9.5 4 8.5 8.5 0 1 0 20 14.5z',
  camera: 'M4 8h4l2-3h4l2 3h4v11H4zM12 16.5a3.5 3.5 0 1 0 0-7 3.5 3.5 0 0 0 0 7z',
  link: 'M10 14a4 4 0 0 0 6 .4l3-3a4 4 0 0 0-5.7-5.7l-1.2 1.2M14 10a4 4 0 0 0-6-.4l-3 3a4 4 0 0 0 5.7 5.7l1.2-1.2',
  settings: 'M4 7h9M17 7h3M15 5v4M4 17h3M11 17h9M9 15v4M4 12h3',
  help: 'M9 9a3 3 0 1 1 4.2 2.7c-.8.4-1.2 1-1.2 1.8v.5M12 17.5v.2M12 22a10 10 0 1 0 0-20 10 10 0 0 0 0 20z',
  panel: 'M4 5h16v14H4zM14 5v14M16.5 9h1.5M16.5 12h1.5',
  close: 'M6 6l12 12M18 6L6 18',
} as const;

export type IconName = keyof typeof icons;

export function icon(name: IconName): SVGSVGElement {
  const svg = document.createElementNS('http://www.w3.org/2000/svg', 'svg');
  svg.setAttribute('viewBox', '0 0 24 24');
  svg.setAttribute('aria-hidden', 'true');
  svg.classList.add('icon');
  const path = document.createElementNS('http://www.w3.org/2000/svg', 'path');
  path.setAttribute('d', icons[name]);
  svg.append(path);
  return svg;
}

export interface ButtonOptions {
  icon: IconName;
  label: string; // read aloud, and shown when the pointer rests on it
  key?: string;
  pressed?: boolean; // a toggle
  click: () => void;
}

export function iconButton(options: ButtonOptions): HTMLButtonElement {
  const title = options.key ? `${options.label} (${options.key})` : options.label;
  const button = h('button', { type: 'button', class: 'icon-button', 'aria-label': options.label, title });
  if (options.pressed !== undefined) button.setAttribute('aria-pressed', String(options.pressed));
  button.append(icon(options.icon));
  button.addEventListener('click', () => options.click());
  return button;
}

export function setIcon(button: HTMLButtonElement, name: IconName): void {
  if (button.dataset.icon === name) return;
  button.dataset.icon = name;
  button.replaceChildren(icon(name));
}

// Writes only what is different: a text that is set again is laid out again.
export function setText(element: Element, text: string): void {
  if (element.textContent !== text) element.textContent = text;
}

// A canvas as sharp as the screen; returns its context with one unit per CSS pixel.
export function sharpContext(canvas: HTMLCanvasElement, width: number, height: number): CanvasRenderingContext2D {
  const ratio = Math.min(2, window.devicePixelRatio || 1);
  const w = Math.round(width * ratio);
  const t = Math.round(height * ratio);
  if (canvas.width !== w || canvas.height !== t) {
    canvas.width = w;
    canvas.height = t;
  }
  const context = canvas.getContext('2d')!;
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  return context;
}
