// A gateway without a session: `npm run mock` serves dist/ and talks to the page as `soda view` does, about bodies that
// it makes up. For work on the page; see mock --help.
import { create, fromBinary, type MessageInitShape } from '@bufbuild/protobuf';
import { readFile } from 'node:fs/promises';
import { createServer } from 'node:http';
import { dirname, extname, join, normalize } from 'node:path';
import { fileURLToPath } from 'node:url';
import { parseArgs } from 'node:util';
import { WebSocketServer } from 'ws';
import {
  AnswerSchema, BodyListSchema, ClocksSchema, EndedSchema, EventsSchema, FromPageSchema, RollbackSchema, WelcomeSchema,
  TransferSchema, TransfersSchema, WorldsSchema, WorldStateSchema, type BodyList, type Do, type Mesh, type ToPage, type Transfer,
} from '../src/gen/viewer_pb';
import { protocol } from '../src/model/session';
import { Client } from './mock/client';
import { boxMesh, capsuleMesh, makeScene, sphereMesh } from './mock/scenes';
import { ahead, dt, lead, Simulation } from './mock/simulation';

const { values: options } = parseArgs({
  options: {
    help: { type: 'boolean', default: false },
    port: { type: 'string', default: '8089' },
    bodies: { type: 'string', default: '1000' },
    worlds: { type: 'string', default: '4' },
    scene: { type: 'string', default: 'city' }, // or cubes
    token: { type: 'string', default: 'mock' },
    plain: { type: 'boolean', default: false }, // all bodies grey
    trouble: { type: 'boolean', default: false }, // world 1 falls behind, then silent, for some seconds at a time
    balance: { type: 'boolean', default: false }, // every 60 steps some cells change hands
    replay: { type: 'boolean', default: false },
    gather: { type: 'string', default: '0' }, // s until the run begins
    end: { type: 'string', default: '0' }, // s until the session ends; 0: never
    mute: { type: 'boolean', default: false }, // lets pages connect, and tells them nothing
  },
});
if (options.help) {
  console.log('mock [--port N] [--bodies N] [--worlds N] [--scene city|cubes] [--token T] [--plain] [--trouble] [--balance] [--replay] [--gather S] [--end S] [--mute]');
  process.exit(0);
}

const worlds = Number(options.worlds);
const bodies = Number(options.bodies);
const scene = makeScene(options.scene, bodies, worlds, options.plain);
const simulation = new Simulation(scene, bodies > 4000 ? 120 : 400);
const clients = new Set<Client>();
let paused = false;
let pace = 1;
let extra = 0; // steps to do while paused
const began = performance.now();
const seconds = () => (performance.now() - began) / 1000;
const gathering = () => seconds() < Number(options.gather);
const redone = new Array<number>(worlds).fill(0);
const rollbacks = new Array<number>(worlds).fill(0);
const tell = (what: ToPage['what']) => clients.forEach((client) => client.send(what));

// A world that is in trouble for 8 of 20 seconds: first behind, then silent.
const troubled = (w: number) => options.trouble && w === 1 && seconds() % 20 > 8;
const silent = (w: number) => troubled(w) && seconds() % 20 > 14;
function clocksOf(w: number): { clock: bigint; front: bigint; final: bigint; silent: boolean } {
  const wave = Math.sin(seconds() * (0.7 + 0.13 * w) + w) * 0.5 + 0.5;
  const back = troubled(w) ? 26 : 0;
  const clock = simulation.displayed + Math.round(10 + (ahead - 10) * wave);
  const final = simulation.displayed + Math.round(-3 + (lead + 2) * Math.sin(seconds() * 1.7 + 2 * w) ** 2) - back;
  const front = Math.round(final + (clock - final) * 0.7);
  return { clock: BigInt(clock), front: BigInt(front), final: BigInt(Math.max(0, final)), silent: silent(w) };
}
const finalOf = () => Math.min(...Array.from({ length: worlds }, (_, w) => Number(clocksOf(w).final)));

function clocks(): void {
  tell({
    case: 'clocks',
    value: create(ClocksSchema, {
      displayed: BigInt(simulation.displayed), pace, paused, gathering: gathering(),
      speed: paused ? 0 : (pace || 3) * (options.trouble && seconds() % 20 > 12 ? 0.6 : 1),
      oldest: BigInt(simulation.oldest), newest: BigInt(simulation.newest), final: BigInt(finalOf()),
      world: Array.from({ length: worlds }, (_, w) => clocksOf(w)),
    }),
  });
}

function worldStates(): void {
  const owned = new Array<number>(worlds).fill(0);
  const state = simulation.state(simulation.displayed)!;
  for (let i = 0; i < state.there.length; i++) if (state.there[i]) owned[simulation.ownerOf(state, i)]!++;
  scene.territories.goTo(simulation.displayed);
  const cells = scene.territories.cells(worlds);
  const world = owned.map((count, w): MessageInitShape<typeof WorldStateSchema> => ({
    host: 'mock', pid: 1000 + w,
    state: gathering() ? (w < worlds / 2 ? 'ready' : 'unknown') : silent(w) ? 'silent' : 'running',
    bodies: BigInt(count), cells: BigInt(cells[w]!), neighbours: worlds - 1,
    waitingFor: troubled(w) ? -1 : options.trouble && troubled(1) ? 1 : seconds() % 3 < 1 ? (w + 1) % worlds : -1,
    stepsPerSecond: 60 * pace, load: Math.min(1, 0.25 + count / bodies + 0.15 * Math.sin(seconds() + w) + (troubled(w) ? 0.4 : 0)),
    waiting: 0.1 + 0.08 * Math.sin(seconds() * 0.6 + w), syncs: BigInt(simulation.displayed * 3), mixedIslands: 5n,
    rollbacks: BigInt(rollbacks[w]!), bodiesRedone: BigInt(redone[w]!), refused: 0n,
    lead: clocksOf(w).clock - clocksOf(w).final, bytesPerSecond: 2.1e5 * (1 + w), memory: BigInt(180e6 + 12e6 * w), cpu: 0.6,
  }));
  tell({ case: 'worlds', value: create(WorldsSchema, { world }) });
}

function rollback(world: number, step: number, steps: number, count: number): void {
  rollbacks[world]!++;
  redone[world]! += count;
  tell({ case: 'rollback', value: create(RollbackSchema, { world, step: BigInt(step), steps, bodies: BigInt(count), milliseconds: 0.3 + count / 40 }) });
}

// Now and then something near a border turns out otherwise.
function someRollback(): void {
  const state = simulation.state(simulation.displayed)!;
  const w = Math.floor(Math.random() * worlds);
  let count = 0;
  for (let i = Math.floor(Math.random() * 40); i < state.there.length && count < 60; i += 1 + Math.floor(Math.random() * 8)) {
    if (!state.there[i] || state.asleep[i] || simulation.ownerOf(state, i) !== w || !(simulation.flagsOf(state, i, w) & 2)) continue;
    simulation.redone.set(i, simulation.displayed + 2);
    count++;
  }
  if (count) rollback(w, simulation.displayed + 2, 3 + Math.floor(Math.random() * 12), count * 4);
}

// One world after the other gives a neighbour the cells along their border, and gets them back the next time.
const transfers: Transfer[] = [];
function someTransfer(): void {
  const { territories } = scene;
  const [nx, ny, nz] = territories.size;
  const step = BigInt(simulation.newest + 8);
  territories.goTo(Number(step));
  const last = transfers.at(-1);
  const number = transfers.length;
  let transfer = create(TransferSchema, { step, giver: last?.taker, taker: last?.giver, cell: last?.cell });
  if (number % 2 === 0) {
    const giver = (number / 2) % worlds;
    const ownerBeside = (cell: number, along: number, by: number, size: number) => {
      const at = (Math.floor(cell / along) % size) + by;
      return at < 0 || at >= size ? giver : territories.owner[cell + by * along]!;
    };
    const owners = (cell: number) =>
      [[1, nx], [nx, ny], [nx * ny, nz]].flatMap(([along, size]) => [-1, 1].map((by) => ownerBeside(cell, along!, by, size!)));
    const own = [...territories.owner.keys()].filter((cell) => territories.owner[cell] === giver);
    const taker = own.flatMap(owners).find((w) => w !== giver);
    if (taker === undefined) return;
    transfer = create(TransferSchema, { step, giver, taker, cell: own.filter((cell) => owners(cell).includes(taker)) });
  }
  transfers.push(transfer);
  territories.add([transfer]);
  tell({ case: 'transfers', value: create(TransfersSchema, { transfer: [transfer] }) });
}

function handle(client: Client, request: Do): void {
  const { number, what } = request;
  const answer = (init: MessageInitShape<typeof AnswerSchema>) => client.send({ case: 'answer', value: create(AnswerSchema, { number, ...init }) });
  if (!client.mayAct && !options.replay) return answer({ accepted: false, reason: 'this link has no token' });
  if (what.case === 'pause') paused = true;
  else if (what.case === 'resume') paused = false;
  else if (what.case === 'speed') pace = what.value;
  else if (what.case === 'steps') extra += Number(what.value);
  else if (what.case === 'seek') simulation.displayed = Math.min(simulation.newest - ahead, Math.max(simulation.oldest, Number(what.value)));
  else if (what.case === 'action') {
    const done = simulation.act(what.value);
    if (done.reason !== undefined) return answer({ accepted: false, reason: done.reason });
    if (done.body) {
      const shape = what.value.kind.case === 'spawn' ? what.value.kind.value.body?.shape[0]?.kind : undefined;
      const box = shape?.case === 'box' ? shape.value.size : undefined;
      const radius = shape?.case === 'sphere' || shape?.case === 'capsule' ? shape.value.radius : 0.5;
      const mesh =
        shape?.case === 'sphere' ? sphereMesh(radius)
        : shape?.case === 'capsule' ? capsuleMesh(radius, shape.value.length)
        : boxMesh(box?.x ?? 1, box?.y ?? 1, box?.z ?? 1);
      scene.bodies[done.index]!.mesh = scene.meshes.push(mesh) - 1;
      tell({ case: 'bodies', value: bodyList(done.index, [mesh]) });
      clients.forEach((each) => (each.anew = true));
    }
    answer({ accepted: true, step: BigInt(done.step), body: done.body, logged: done.logged });
    const state = simulation.state(done.step)!;
    rollback(simulation.ownerOf(state, done.index), done.step, done.steps, done.steps);
    return;
  }
  answer({ accepted: true, step: BigInt(simulation.displayed) });
}

function bodyList(first: number, meshes: Mesh[] = []): BodyList {
  const list = scene.bodies.slice(first);
  return create(BodyListSchema, {
    first, meshes, id: list.map((b) => b.id), mesh: list.map((b) => b.mesh), colour: list.map((b) => b.colour), mass: list.map((b) => b.mass),
  });
}

const dist = process.env.SODA_PAGE_OUT ?? join(dirname(fileURLToPath(import.meta.url)), '../dist');
const types: Record<string, string> = { '.html': 'text/html', '.js': 'text/javascript', '.css': 'text/css' };
// Stricter than the gateway's, so that the page stays within it.
const policy = "default-src 'self'; img-src 'self' data: blob:; connect-src 'self' ws: wss:";
const server = createServer((request, response) => {
  const path = normalize(new URL(request.url ?? '/', 'http://mock').pathname);
  const file = join(dist, path === '/' ? 'index.html' : path);
  readFile(file).then(
    (data) => response.writeHead(200, { 'content-type': types[extname(file)] ?? 'application/octet-stream', 'content-security-policy': policy }).end(data),
    () => response.writeHead(404).end(),
  );
});
new WebSocketServer({ server, path: '/ws' }).on('connection', (socket, request) => {
  if (options.mute) return;
  const token = new URL(request.url ?? '/', 'http://mock').searchParams.get('token');
  const client = new Client(socket, token === options.token);
  client.send({
    case: 'welcome',
    value: create(WelcomeSchema, {
      protocol, version: 'mock', session: options.replay ? 'mock.rec' : 'mock', scene: `${scene.name}, ${bodies} bodies`, replay: options.replay, mayAct: client.mayAct,
      dt, worlds, lastStep: 100000n, window: ahead, lead, grid: scene.grid, meshes: scene.meshes, statics: scene.statics,
      low: scene.low, high: scene.high, gravity: [0, 0, scene.gravity],
    }),
  });
  client.send({ case: 'bodies', value: bodyList(0) });
  client.send({ case: 'transfers', value: create(TransfersSchema, { transfer: transfers }) });
  clients.add(client);
  socket.on('close', () => clients.delete(client));
  socket.on('message', (data: Buffer) => {
    const { what } = fromBinary(FromPageSchema, new Uint8Array(data));
    if (what.case === 'shown') client.confirmed = what.value.number;
    if (what.case === 'look') {
      client.held = what.value.which.case === 'step' ? Number(what.value.which.value) : null;
      client.offset = what.value.which.case === 'offset' ? Number(what.value.which.value) : 0;
    }
    if (what.case === 'do') handle(client, what.value);
  });
});

let due = performance.now();
setInterval(() => {
  const now = performance.now();
  for (let k = 0; due < now && k < 4; k++) {
    due += (1000 * dt) / (pace || 3);
    if (gathering() || (paused && extra === 0)) continue;
    if (paused) extra--;
    simulation.advance();
    if (options.balance && simulation.displayed % 60 === 0) someTransfer();
  }
  due = Math.max(due, now - 100);
  const final = finalOf();
  clients.forEach((client) => client.frame(simulation, final));
  for (const [body, until] of simulation.redone) if (until < simulation.displayed || paused) simulation.redone.delete(body);
}, 4);
setInterval(clocks, 50);
setInterval(worldStates, 500);
setInterval(() => !paused && !gathering() && Math.random() < 0.5 && someRollback(), 300);
let wasSilent = false;
setInterval(() => {
  if (silent(1) === wasSilent) return;
  wasSilent = silent(1);
  tell({ case: 'events', value: create(EventsSchema, { text: [wasSilent ? 'world 1 fell silent' : 'world 1 is back'] }) });
}, 200);
if (Number(options.end) > 0)
  setTimeout(() => {
    tell({ case: 'ended', value: create(EndedSchema, { reason: 'All steps are done.', failed: false }) });
    setTimeout(() => process.exit(0), 300);
  }, 1000 * Number(options.end));

server.listen(Number(options.port), '127.0.0.1', () => console.log(`mock gateway: http://127.0.0.1:${options.port}/?token=${options.token}`));
