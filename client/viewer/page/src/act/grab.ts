// One drag of a body: Grab at once, MoveGrab while the pointer moves, Release at the end. The grab's number is known
// only with the answer; until then the newest target is kept, and a release waits.
import { create } from '@bufbuild/protobuf';
import { Plane, Quaternion, Vector3, type Ray } from 'three';
import { GrabSchema, MoveGrabSchema, ReleaseSchema } from '../gen/action_pb';
import { noAnswer, notConnected, type Requests } from '../net/requests';
import { vec3 } from './spawning';

const movesPerSecond = 30;

export class Grabbing {
  readonly target: Vector3;
  readonly point: Vector3; // in the body's axes
  private plane = new Plane();
  private logged: bigint | null = null;
  private refused = false;
  private released = false;
  private sent: Vector3;
  private sentAt = 0;
  private timer = 0;

  constructor(
    private readonly requests: Requests,
    readonly body: number,
    id: bigint,
    hit: Vector3,
    centre: Vector3,
    turn: Quaternion,
    facing: Vector3, // where the camera looks
  ) {
    this.target = hit.clone();
    this.sent = hit.clone();
    this.point = hit.clone().sub(centre).applyQuaternion(turn.clone().invert());
    this.plane.setFromNormalAndCoplanarPoint(facing.clone().negate(), hit);
    void requests
      .act({ case: 'grab', value: create(GrabSchema, { body: id, point: vec3(this.point), target: vec3(this.target) }) })
      .then((answer) => {
        if (!answer.accepted) {
          this.refused = true;
          return;
        }
        this.logged = answer.logged;
        if (this.released) this.sendRelease();
        else this.sendMove();
      });
  }

  get over(): boolean {
    return this.refused;
  }

  // To where the pointer's ray meets the plane that faces the camera.
  drag(ray: Ray): void {
    const at = ray.intersectPlane(this.plane, new Vector3());
    if (at) this.target.copy(at);
    this.sendMove();
  }

  // Nearer or farther, by the wheel.
  reach(camera: Vector3, factor: number): void {
    const away = this.target.clone().sub(camera);
    this.target.copy(camera).addScaledVector(away, factor);
    this.plane.setFromNormalAndCoplanarPoint(this.plane.normal, this.target);
    this.sendMove();
  }

  release(): void {
    if (this.released) return;
    this.sendMove(true);
    this.released = true;
    clearTimeout(this.timer);
    if (this.logged !== null) this.sendRelease();
  }

  private sendMove(now = false): void {
    if (this.logged === null || this.released || this.target.equals(this.sent)) return;
    const wait = this.sentAt + 1000 / movesPerSecond - performance.now();
    if (wait > 0 && !now) {
      clearTimeout(this.timer);
      this.timer = window.setTimeout(() => this.sendMove(), wait);
      return;
    }
    this.sentAt = performance.now();
    this.sent.copy(this.target);
    void this.requests.act({
      case: 'move',
      value: create(MoveGrabSchema, { grab: this.logged, target: vec3(this.target) }),
    });
  }

  // Until it has arrived: a spring that nobody lets go of would pull for ever.
  private sendRelease(triesLeft = 30): void {
    void this.requests
      .act({ case: 'release', value: create(ReleaseSchema, { grab: this.logged! }) }, triesLeft < 30)
      .then((answer) => {
        if (!answer.accepted && [notConnected, noAnswer].includes(answer.reason) && triesLeft > 0)
          setTimeout(() => this.sendRelease(triesLeft - 1), 1000);
      });
  }
}
