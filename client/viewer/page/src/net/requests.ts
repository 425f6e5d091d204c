// What the user asks for (Do), and the answers. Each has a number of its own; an answer that does not come because the
// connection broke is a refusal.
import { create } from '@bufbuild/protobuf';
import { ActionSchema, type Action } from '../gen/action_pb';
import { DoSchema, AnswerSchema, type Answer, type Do } from '../gen/viewer_pb';
import type { Connection } from './connection';

export interface AnswerRecord {
  number: number;
  asked: string; // "push", "grab", "pause", ...
  accepted: boolean;
  reason: string;
  step: number;
  body: bigint;
  logged: bigint;
  milliseconds: number; // from asking to the answer
}

interface Pending {
  asked: string;
  since: number;
  quiet: boolean;
  resolve: (answer: Answer) => void;
}

const keep = 200;
export const notConnected = 'there is no connection';
export const noAnswer = 'the session does not answer'; // client/buffer says so

export class Requests {
  readonly answers: AnswerRecord[] = [];
  private next = 1;
  private pending = new Map<number, Pending>();

  constructor(
    private readonly connection: () => Connection,
    private readonly told: (record: AnswerRecord) => void,
  ) {}

  // `quiet`: a refusal is not worth a message.
  act(kind: Action['kind'], quiet = false): Promise<Answer> {
    return this.ask({ case: 'action', value: create(ActionSchema, { kind }) }, kind.case ?? 'nothing', quiet);
  }

  ask(what: Do['what'], asked: string = what.case ?? 'nothing', quiet = false): Promise<Answer> {
    const number = this.next++;
    return new Promise((resolve) => {
      this.pending.set(number, { asked, since: performance.now(), quiet, resolve });
      if (!this.connection().send({ case: 'do', value: create(DoSchema, { number, what }) }))
        this.refuse(number, notConnected);
    });
  }

  answered(answer: Answer): void {
    const of = this.pending.get(answer.number);
    if (!of) return;
    this.pending.delete(answer.number);
    const record: AnswerRecord = {
      number: answer.number,
      asked: of.asked,
      accepted: answer.accepted,
      reason: answer.reason,
      step: Number(answer.step),
      body: answer.body,
      logged: answer.logged,
      milliseconds: performance.now() - of.since,
    };
    this.answers.push(record);
    if (this.answers.length > keep) this.answers.shift();
    if (record.accepted || !of.quiet) this.told(record);
    of.resolve(answer);
  }

  lost(): void {
    for (const number of [...this.pending.keys()]) this.refuse(number, notConnected);
  }

  private refuse(number: number, reason: string): void {
    this.answered(create(AnswerSchema, { number, accepted: false, reason }));
  }
}
