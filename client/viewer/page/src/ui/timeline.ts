// The timeline at the bottom: pausing and speed, the worlds' clocks, and the handle that says which step is shown. Drawn
// into the past it shows what was; drawn into the future, what the worlds have computed already and may still change.
import type { Looking } from '../model/look';
import type { Session } from '../model/session';
import { Axis } from './axis';
import { barsHeight, drawBars, rowHeight } from './bars';
import { h, icon, iconButton, setIcon, setText } from './dom';
import { css, worldColour } from '../draw/colours';
import { throttled } from '../throttle';
import { clockTime, count, digits, signed } from './words';

export interface TimelineHost {
  pause(on: boolean): void;
  stepOnce(): void;
  speed(multiple: number): void; // 0: as fast as possible
  seek(step: number): void;
  trouble(world: number): { short: string; long: string } | null;
  shown(): number; // step of the picture
  anticipated(): boolean;
  whyNoPace(): string;
}

const fastest = 4;

export class Timeline {
  private axis = new Axis();
  private play: HTMLButtonElement;
  private next: HTMLButtonElement;
  private slider: HTMLInputElement;
  private speedText: HTMLOutputElement;
  private max: HTMLButtonElement;
  private state: HTMLElement;
  private stepText: HTMLElement;
  private liveButton: HTMLButtonElement;
  private holdButton: HTMLButtonElement;
  private canvas: HTMLCanvasElement;
  private names: HTMLElement;
  private handle: HTMLElement;
  private track: HTMLElement;
  private dragging = false;
  private sliding = 0; // ms, until when the slider is the user's
  private paused = false;
  private slowSince = 0;

  constructor(
    root: HTMLElement,
    private readonly session: Session,
    private readonly looking: Looking,
    private readonly host: TimelineHost,
  ) {
    this.play = iconButton({ icon: 'pause', label: 'Pause', key: 'space', click: () => this.togglePause() });
    this.next = iconButton({ icon: 'step', label: 'One step', key: '.', click: () => host.stepOnce() });
    // Logarithmic: half and double speed are equally far from real time.
    this.slider = h('input', { type: 'range', min: -1, max: Math.log10(fastest), step: 0.01, value: 0, 'aria-label': 'Speed' });
    this.speedText = h('output', { class: 'speed' }, '1 ×');
    this.max = h('button', { type: 'button', class: 'text-button', title: 'As fast as possible', 'aria-pressed': 'false' }, 'max');
    const speed = throttled((multiple: number) => host.speed(multiple), 100);
    this.slider.addEventListener('input', () => {
      const value = 10 ** Number(this.slider.value);
      this.sliding = performance.now() + 700;
      speed(Math.abs(value - 1) < 0.06 ? 1 : Number(value.toFixed(2)));
    });
    this.max.addEventListener('click', () => host.speed(this.max.getAttribute('aria-pressed') === 'true' ? 1 : 0));
    this.state = h('div', { class: 'state', role: 'status', 'aria-live': 'polite' });
    this.stepText = h('div', { class: 'step-text' });
    this.liveButton = h(
      'button',
      { type: 'button', class: 'text-button live', title: 'Show the displayed step again (L)' },
      icon('live'),
      'Live',
    );
    this.liveButton.addEventListener('click', () => this.goLive());
    this.holdButton = h(
      'button',
      { type: 'button', class: 'text-button', title: 'Stay at this step while time goes on (K)', 'aria-pressed': 'false' },
      icon('hold'),
      'Hold',
    );
    this.holdButton.addEventListener('click', () => this.toggleHold());
    this.canvas = h('canvas', { class: 'bars', 'aria-hidden': 'true' });
    this.canvas.style.height = `${barsHeight(1)}px`; // until something is told: a canvas by itself fills the page
    this.names = h('div', { class: 'row-names' });
    this.handle = h('div', { class: 'handle', role: 'slider', tabindex: 0, 'aria-label': 'Step that is shown' });
    this.track = h('div', { class: 'track' }, this.canvas, this.handle);
    root.append(
      h(
        'div',
        { class: 'transport' },
        this.play,
        this.next,
        h('label', { class: 'speed-box' }, this.slider, this.speedText),
        this.max,
        h('span', { class: 'spacer' }),
        this.state,
        h('span', { class: 'spacer' }),
        this.stepText,
        this.holdButton,
        this.liveButton,
      ),
      h('div', { class: 'tracks' }, this.names, this.track),
    );
    this.track.addEventListener('pointerdown', (event) => {
      if (event.button !== 0) return;
      this.dragging = true;
      this.track.setPointerCapture(event.pointerId);
      this.handle.focus({ preventScroll: true });
      this.dragTo(event);
    });
    this.track.addEventListener('pointermove', (event) => this.dragging && this.dragTo(event));
    for (const end of ['pointerup', 'pointercancel'])
      this.track.addEventListener(end, () => (this.dragging = false));
  }

  togglePause(): void {
    this.host.pause(!this.paused);
  }

  goLive(): void {
    this.looking.at(0);
  }

  toggleHold(): void {
    if (this.looking.held !== null) this.looking.at(this.looking.difference(this.session.displayed));
    else this.looking.hold(this.host.shown());
  }

  // By so many steps, with the arrow keys.
  scrub(by: number): void {
    if (this.session.welcome?.replay) {
      this.seek(this.session.displayed + by);
      return;
    }
    if (this.looking.held !== null) this.looking.hold(this.clamp(this.looking.held + by));
    else this.looking.at(this.clamp(this.session.displayed + this.looking.offset + by) - this.session.displayed);
  }

  update(): void {
    const { session, axis } = this;
    const clocks = session.clocks;
    if (!clocks) return;
    const replay = !!session.welcome?.replay;
    if (replay) axis.recording(session.oldest, session.newest);
    else {
      let newest = session.newest;
      for (const row of session.rows) newest = Math.max(newest, row.clock);
      axis.live(session.displayed, session.oldest, newest);
    }
    this.paused = clocks.paused;
    setIcon(this.play, clocks.paused ? 'play' : 'pause');
    this.play.setAttribute('aria-label', clocks.paused ? 'Resume' : 'Pause');
    this.play.title = clocks.paused ? 'Resume (space)' : 'Pause (space)';
    const may = session.mayPace;
    for (const control of [this.play, this.slider, this.max]) {
      control.disabled = !may;
      if (!may) control.title = this.host.whyNoPace();
    }
    this.next.disabled = !may || !clocks.paused;
    this.max.setAttribute('aria-pressed', String(clocks.pace === 0));
    if (performance.now() > this.sliding && clocks.pace > 0) this.slider.value = String(Math.log10(clocks.pace));
    setText(this.speedText, clocks.pace === 0 ? 'max' : `${digits(clocks.pace, 2)} ×`);

    this.updateState(replay);
    this.updateRows();
    const style = getComputedStyle(document.documentElement);
    const colour = (name: string) => style.getPropertyValue(name).trim();
    drawBars(
      this.canvas,
      session,
      axis,
      { text: colour('--muted'), line: colour('--line'), track: colour('--track'), bad: colour('--bad') },
      (world) => this.host.trouble(world) !== null,
    );
    const at = session.displayed + this.difference();
    this.handle.style.left = `${Math.min(axis.width, Math.max(0, axis.x(at)))}px`;
    this.handle.setAttribute('aria-valuemin', String(session.oldest));
    this.handle.setAttribute('aria-valuemax', String(session.newest));
    this.handle.setAttribute('aria-valuenow', String(at));
    this.handle.setAttribute('aria-valuetext', `step ${at}, ${this.state.textContent ?? ''}`);
  }

  // From the displayed step to that which is shown. The gateway may not be able to show what was asked for.
  private difference(): number {
    const { session, looking } = this;
    const asked = looking.difference(session.displayed);
    if (asked >= session.oldest - session.displayed && asked <= session.newest - session.displayed) return asked;
    return this.host.shown() - session.displayed;
  }

  private updateState(replay: boolean): void {
    const { session, looking } = this;
    const clocks = session.clocks!;
    const difference = this.difference();
    const live = looking.live || replay;
    let kind = 'live';
    let text = !replay ? 'live' : session.displayed >= session.newest ? 'end of the recording' : 'recording';
    if (session.ended) {
      kind = 'wait';
      text = 'ended';
    } else if (clocks.gathering) {
      kind = 'wait';
      text = 'waiting for worlds';
    } else if (!live && difference > 0) {
      kind = 'future';
      text = this.host.anticipated()
        ? `anticipated: ${signed(difference)} steps, may still change`
        : `ahead: ${signed(difference)} steps, final already`;
    } else if (!live && difference < 0) {
      kind = 'past';
      text = `past: ${signed(difference)} steps`;
    } else if (clocks.paused) {
      kind = 'paused';
      text = 'paused';
    } else if (this.isSlow(clocks.pace, clocks.speed)) {
      kind = 'slow';
      // In twentieths, so that it is not another text (and read aloud) each time.
      const share = Math.round((20 * clocks.speed) / clocks.pace) / 20;
      text = `slow motion: ${digits(share, 2)} of the speed asked for`;
    }
    if (clocks.paused && !live) text += ' (paused)';
    if (looking.held !== null && !live) text += ' (held)';
    this.state.dataset.kind = kind;
    setText(this.state, text);
    const step = session.displayed + difference;
    const dt = session.welcome?.dt ?? 0;
    const speed = clocks.paused ? '' : ` · ${digits(clocks.speed, 2)} × real time`;
    setText(
      this.stepText,
      replay
        ? `step ${count(step)} of ${count(session.newest)} · ${clockTime(step * dt)} s`
        : `step ${count(step)} · ${clockTime(step * dt)} s · final ${count(session.final)}${speed}`,
    );
    this.liveButton.disabled = live;
    this.liveButton.hidden = this.holdButton.hidden = replay;
    this.holdButton.setAttribute('aria-pressed', String(looking.held !== null));
  }

  // For some time: after a pause the speed of the last second is lower, too.
  private isSlow(pace: number, speed: number): boolean {
    const now = performance.now();
    if (pace === 0 || speed >= 0.9 * pace || this.session.clocks?.paused) this.slowSince = 0;
    else if (this.slowSince === 0) this.slowSince = now;
    return this.slowSince > 0 && now - this.slowSince > 1500;
  }

  private updateRows(): void {
    const worlds = Math.max(1, this.session.rows.length);
    this.canvas.style.height = `${barsHeight(worlds)}px`;
    const named = rowHeight(worlds) >= 9 && !this.session.welcome?.replay;
    this.names.hidden = !named;
    if (!named) return;
    while (this.names.children.length > worlds) this.names.lastChild!.remove();
    while (this.names.children.length < worlds) {
      const w = this.names.children.length;
      const name = h('div', { class: 'row-name', style: `--world:${css(worldColour(w))}` });
      this.names.append(name);
    }
    for (let w = 0; w < worlds; w++) {
      const name = this.names.children[w] as HTMLElement;
      const trouble = this.host.trouble(w);
      name.style.height = `${rowHeight(worlds)}px`;
      name.classList.toggle('bad', trouble !== null);
      name.title = trouble?.long ?? '';
      setText(name, trouble ? `world ${w} · ${trouble.short}` : `world ${w}`);
    }
  }

  private dragTo(event: PointerEvent): void {
    const box = this.canvas.getBoundingClientRect();
    let step = this.clamp(this.axis.step(event.clientX - box.left));
    if (this.session.welcome?.replay) {
      this.seek(step);
      return;
    }
    // The displayed step attracts the handle a little, or one would never get back to it.
    if (Math.abs(this.axis.x(step) - this.axis.x(this.session.displayed)) < 5) step = this.session.displayed;
    this.looking.at(step - this.session.displayed);
  }

  private clamp(step: number): number {
    return Math.round(Math.min(this.session.newest, Math.max(this.session.oldest, step)));
  }

  private readonly seek = throttled((step: number) => this.host.seek(this.clamp(step)), 60);
}
