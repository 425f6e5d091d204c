// A real session for tests: a scene, `soda run` with its worlds, `soda view` beside it, and what `soda status` says of
// them. All of one process's sessions are in a DDS domain of their own and on this machine only.
import { spawn, type ChildProcess } from 'node:child_process';
import { existsSync, mkdtempSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';

const limit = 60_000; // ms, for what a slow machine may take
// Ports are computed from the domain: beyond 100 they are among those that the system hands out.
const network = ['--interface', 'local', '--domain', String(1 + (process.pid % 100))];

// Of idl/viewer.proto, as JSON has it: int64 are strings.
export interface Status {
  clocks: { displayed: string; final: string; paused: boolean; world: { final: string; silent: boolean }[] };
  worlds: { world: { pid: number; state: string; bodies: string }[] };
}

export function missing(): string | null {
  const bin = process.env.SODA_BIN;
  if (!bin) return 'SODA_BIN does not say where soda is';
  for (const file of [join(bin, 'soda'), join(bin, 'soda-world'), process.env.CHROMIUM ?? '/usr/bin/chromium'])
    if (!existsSync(file)) return `there is no ${file}`;
  return null;
}

// Who ends the tests from outside ends what they have started, too: `exit` below is heard only if the process exits.
for (const [signal, code] of [['SIGINT', 130], ['SIGTERM', 143]] as const) process.once(signal, () => process.exit(code));

// A program that was started here, and what it has written.
class Program {
  output = '';
  readonly ended: Promise<number | null>;
  private readonly child: ChildProcess;
  private readonly name: string;

  constructor(args: string[]) {
    this.name = `soda ${args.join(' ')}`;
    this.child = spawn(join(process.env.SODA_BIN!, 'soda'), args, { stdio: ['ignore', 'pipe', 'pipe'] });
    const stop = () => this.child.kill('SIGTERM');
    process.once('exit', stop); // should a test end without stopping it
    for (const stream of [this.child.stdout!, this.child.stderr!]) stream.on('data', (data: Buffer) => (this.output += data.toString()));
    this.ended = new Promise((resolve) => {
      const over = (code: number | null) => {
        process.removeListener('exit', stop);
        resolve(code);
      };
      this.child.once('close', over);
      this.child.once('error', (error) => {
        this.output += error.message;
        over(null);
      });
    });
  }

  // The first match in what it writes; an error when it ends or takes too long.
  async wrote(pattern: RegExp): Promise<RegExpMatchArray> {
    let timer: NodeJS.Timeout | undefined;
    let over = false;
    const late = new Promise<void>((resolve) => (timer = setTimeout(resolve, limit)));
    void Promise.race([this.ended, late]).then(() => (over = true));
    try {
      for (;;) {
        const found = this.output.match(pattern);
        if (found) return found;
        if (over) throw new Error(`${this.name} did not write ${String(pattern)} but: ${this.output}`);
        await new Promise((resolve) => setTimeout(resolve, 20));
      }
    } finally {
      clearTimeout(timer);
    }
  }

  // As Ctrl-C does: `soda run` ends its worlds.
  async stop(signal: 'SIGINT' | 'SIGTERM'): Promise<void> {
    this.child.kill(signal);
    const timer = setTimeout(() => this.child.kill('SIGKILL'), limit);
    await this.ended;
    clearTimeout(timer);
  }

  // To its end, which must be a good one.
  static async run(args: string[]): Promise<string> {
    const program = new Program(args);
    const code = await program.ended;
    if (code !== 0) throw new Error(`${program.name} ended with ${code}: ${program.output}`);
    return program.output;
  }
}

let counter = 0;

export class LiveSession {
  url = ''; // of the page, with the token
  readonly name = `page-${process.pid}-${Date.now()}-${counter++}`;
  private folder = '';
  private run: Program | null = null;
  private view: Program | null = null;

  // Returns once the page is served; the page itself waits for the session to begin.
  async start(scene: string, bodies: number, worlds: number): Promise<void> {
    const folder = (this.folder = mkdtempSync(join(tmpdir(), 'soda-page-')));
    process.once('exit', () => rmSync(folder, { recursive: true, force: true }));
    const file = join(this.folder, `${scene}.scene`);
    await Program.run(['scene', 'make', scene, '--bodies', String(bodies), '--seed', '1', '-o', file]);
    this.run = new Program(['run', file, '--session', this.name, '--worlds', String(worlds), '--steps', '100000000', '-q', ...network]);
    const page = process.env.SODA_PAGE ? ['--page', process.env.SODA_PAGE] : [];
    this.view = new Program(['view', '--session', this.name, '--port', '0', ...page, ...network]);
    this.url = (await this.view.wrote(/http:\/\/localhost:\d+\/\?token=\w+/))[0];
  }

  // The same without the right to act.
  get watchUrl(): string {
    return this.url.replace(/\?.*/, '');
  }

  // Takes a second: it measures.
  async status(): Promise<Status> {
    return JSON.parse(await Program.run(['status', '--session', this.name, '--json', ...network])) as Status;
  }

  // Exit code and words of `soda run`, once it has ended.
  async ended(): Promise<{ code: number | null; output: string }> {
    const code = await this.run!.ended;
    return { code, output: this.run!.output };
  }

  async stop(): Promise<void> {
    await Promise.all([this.run?.stop('SIGINT'), this.view?.stop('SIGTERM')]);
  }
}
