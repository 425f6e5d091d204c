// A page that is no browser: it sends what a page could send, whether or not the page would let its user do so.
import { create, fromBinary, toBinary } from '@bufbuild/protobuf';
import { once } from 'node:events';
import { WebSocket } from 'ws';
import { DoSchema, FromPageSchema, ToPageSchema, type Answer, type Do } from '../src/gen/viewer_pb';

const limit = 60_000; // ms

export class Socket {
  private readonly socket: WebSocket;
  private readonly waiting = new Map<number, (answer: Answer) => void>();
  private readonly welcomed: Promise<void>;
  private next = 1;
  mayAct: boolean | null = null; // as Welcome has said

  // `url`: of the page, with or without the token.
  constructor(url: string) {
    const address = new URL(url);
    const gateway = new URL('ws', url);
    gateway.protocol = 'ws:';
    gateway.search = address.search;
    this.socket = new WebSocket(gateway);
    this.welcomed = new Promise((resolve, reject) => {
      const timer = setTimeout(() => reject(new Error('no welcome')), limit);
      this.socket.on('message', (data: Buffer) => {
        const { what } = fromBinary(ToPageSchema, new Uint8Array(data));
        if (what.case === 'answer') this.waiting.get(what.value.number)?.(what.value);
        if (what.case !== 'welcome') return;
        this.mayAct = what.value.mayAct;
        clearTimeout(timer);
        resolve();
      });
    });
  }

  // Until it is welcomed, which may be some time after the connection is open.
  async open(): Promise<void> {
    await Promise.all([once(this.socket, 'open', { signal: AbortSignal.timeout(limit) }), this.welcomed]);
  }

  ask(what: Do['what']): Promise<Answer> {
    const number = this.next++;
    return new Promise((resolve, reject) => {
      const timer = setTimeout(() => reject(new Error(`no answer to ${what.case}`)), limit);
      this.waiting.set(number, (answer) => {
        clearTimeout(timer);
        resolve(answer);
      });
      this.socket.send(toBinary(FromPageSchema, create(FromPageSchema, { what: { case: 'do', value: create(DoSchema, { number, what }) } })));
    });
  }

  close(): void {
    this.socket.close();
  }
}
