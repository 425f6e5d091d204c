// `window.soda`: what tests and benches look at (README.md tells it by example). Read-only; ids are numbers, or bigints
// where they are too large.
import type { Picture } from './draw/picture';
import type { RollbackRecord, Session } from './model/session';
import type { AnswerRecord, Requests } from './net/requests';

type Id = number | bigint | string;

export interface SodaDebug {
  bodiesDrawn(): number;
  staticTriangles(): number; // of what stands still
  step(): number; // of the picture
  displayed(): number; // that the session shows to those who are live
  anticipated(): boolean; // the picture may still change
  fps(): number;
  delayMilliseconds(): number; // from computing to showing, of the newest step that is shown
  frameMilliseconds(): number; // JavaScript per picture, mean of the last second
  bodyPosition(id: Id): [number, number, number] | null;
  screenPosition(id: Id): [number, number] | null; // CSS pixels on the page
  bodyAt(x: number, y: number): bigint | null; // that a click on the canvas there would meet
  readonly rollbacks: readonly RollbackRecord[];
  readonly answers: readonly AnswerRecord[];
  connected(): boolean;
  worlds(): object[];
  cells(): number[]; // that each world owns at the step that is shown
  mayAct(): boolean;
}

declare global {
  interface Window {
    soda: SodaDebug;
  }
}

export interface Rates {
  fps: number;
  milliseconds: number;
}

export function expose(picture: Picture, session: Session, requests: Requests, rates: Rates, connected: () => boolean): void {
  const find = (id: Id) => {
    const body = picture.bodies.indexOf(BigInt(id));
    return body !== undefined && picture.bodies.present[body] ? body : undefined;
  };
  window.soda = {
    bodiesDrawn: () => picture.instances.drawn,
    staticTriangles: () => picture.statics.triangles(),
    step: () => picture.playback?.step() ?? 0,
    displayed: () => session.displayed,
    anticipated: () => picture.playback?.anticipated ?? false,
    fps: () => rates.fps,
    delayMilliseconds: () => 1000 * (picture.playback?.delay ?? 0),
    frameMilliseconds: () => rates.milliseconds,
    bodyPosition: (id) => {
      const body = find(id);
      if (body === undefined) return null;
      const p = picture.bodies.pos;
      return [p[3 * body]!, p[3 * body + 1]!, p[3 * body + 2]!];
    },
    screenPosition: (id) => {
      const body = find(id);
      return body === undefined ? null : picture.screenPosition(body);
    },
    bodyAt: (x, y) => picture.bodyAt(x, y),
    rollbacks: session.rollbacks,
    answers: requests.answers,
    connected,
    worlds: () =>
      session.worlds.map((state, world) => ({
        world,
        state: state.state,
        bodies: Number(state.bodies),
        load: state.load,
        lead: Number(state.lead),
        rollbacks: Number(state.rollbacks),
        ...session.rows[world],
      })),
    cells: () => picture.cells(),
    mayAct: () => session.mayAct,
  };
}
