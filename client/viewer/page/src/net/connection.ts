// The one WebSocket to the gateway: binary frames, ToPage in, FromPage out. When it breaks it is made again, after
// 0.25 s, then twice as long, up to 5 s; until the session has ended.
import { create, fromBinary, toBinary } from '@bufbuild/protobuf';
import { FromPageSchema, ToPageSchema, type FromPage, type ToPage } from '../gen/viewer_pb';

export type LinkState =
  | { kind: 'connecting' }
  | { kind: 'open' }
  | { kind: 'broken'; retryAt: number; reason: string } // ms, performance.now(); what the gateway said, or ''
  | { kind: 'closed' }; // the session has ended

const firstWait = 250; // ms
const longestWait = 5000;
const openLimit = 8000; // ms until an attempt counts as failed

export class Connection {
  state: LinkState = { kind: 'connecting' };
  private socket: WebSocket | null = null;
  private wait = firstWait;
  private timer = 0;
  private stopped = false;

  constructor(
    private readonly url: string,
    private readonly received: (message: ToPage) => void,
    private readonly changed: (state: LinkState) => void,
  ) {}

  open(): void {
    clearTimeout(this.timer);
    this.drop();
    this.stopped = false;
    this.set({ kind: 'connecting' });
    const socket = new WebSocket(this.url);
    socket.binaryType = 'arraybuffer';
    this.socket = socket;
    const limit = setTimeout(() => socket.close(), openLimit);
    socket.onopen = () => {
      clearTimeout(limit);
      this.set({ kind: 'open' });
    };
    socket.onmessage = (event) => {
      if (!(event.data instanceof ArrayBuffer)) return;
      let message: ToPage;
      try {
        message = fromBinary(ToPageSchema, new Uint8Array(event.data));
      } catch (error) {
        console.error('soda: a message that cannot be read', error);
        return;
      }
      this.wait = firstWait; // it is a gateway, and it talks
      this.received(message);
    };
    socket.onclose = (event) => {
      clearTimeout(limit);
      if (this.socket !== socket) return;
      this.socket = null;
      if (this.stopped) {
        this.set({ kind: 'closed' });
        return;
      }
      this.set({ kind: 'broken', retryAt: performance.now() + this.wait, reason: event.reason });
      this.timer = window.setTimeout(() => this.open(), this.wait);
      this.wait = Math.min(longestWait, 2 * this.wait);
    };
  }

  // Whether more is to come. Otherwise, if the connection breaks, it is not tried again.
  expectMore(more: boolean): void {
    this.stopped = !more;
    if (!more) clearTimeout(this.timer);
  }

  // Whether it could be sent.
  send(what: FromPage['what']): boolean {
    if (this.socket?.readyState !== WebSocket.OPEN) return false;
    this.socket.send(toBinary(FromPageSchema, create(FromPageSchema, { what })));
    return true;
  }

  private drop(): void {
    const old = this.socket;
    this.socket = null;
    old?.close();
  }

  private set(state: LinkState): void {
    this.state = state;
    this.changed(state);
  }
}

// The gateway's address belongs to the page's: same host, beside the page.
export function gatewayUrl(token: string | null): string {
  const url = new URL('ws', location.href.replace(/[?#].*$/, ''));
  url.protocol = location.protocol === 'https:' ? 'wss:' : 'ws:';
  if (token) url.searchParams.set('token', token);
  return url.toString();
}
