// The page against a real session: `soda run` and `soda view` from the folder that SODA_BIN names, with the page that is
// served from there (or from SODA_PAGE). Without them, or without chromium, these are skipped, unless SODA_TEST_MUST_RUN=1.
// Nothing waits for a time, only for what should happen.
import { create } from '@bufbuild/protobuf';
import assert from 'node:assert/strict';
import { after, before, describe, test } from 'node:test';
import type { Browser, Page } from 'playwright-core';
import { ActionSchema, PushSchema } from '../src/gen/action_pb';
import { openPage, startBrowser } from '../tools/browser';
import { LiveSession, missing } from '../tools/session';
import { Socket } from '../tools/socket';

const lacks = missing();
const mustRun = process.env.SODA_TEST_MUST_RUN === '1';
if (lacks && mustRun) test('everything is there that the tests need', () => assert.fail(lacks));
const limit = { timeout: 60_000 };
const bodies = 160;

const open = (browser: Browser, url: string, problems: string[]) =>
  openPage(browser, `${url}#quality=minimal`, 800, 560, true, problems, 250);
const bad = (problems: string[]) => problems.filter((p) => !p.includes('GPU stall')); // of drawing in software
const distance = (a: number[], b: number[]) => Math.hypot(...a.map((x, k) => x - b[k]!));
const position = (page: Page, id: number) => page.evaluate((i) => window.soda.bodyPosition(i)!, id);
const positions = (page: Page) => page.evaluate((n) => Array.from({ length: n }, (_, k) => window.soda.bodyPosition(k + 1)), bodies);

// The page's picture stands at the displayed step, and which that is.
async function pausedStep(page: Page): Promise<number> {
  await page.waitForFunction(
    () => document.querySelector('[aria-label="Resume"]') && window.soda.step() === window.soda.displayed(), null, limit);
  return page.evaluate(() => window.soda.displayed());
}

// Bodies that stand still, the highest first: tops of stacks. Of these, those that the pointer can reach, as the page
// itself says when one clicks on them.
async function* reachable(page: Page): AsyncGenerator<{ id: number; at: [number, number] }> {
  const earlier = await positions(page);
  const step = await page.evaluate(() => window.soda.step());
  await page.waitForFunction((s) => window.soda.step() > s + 20, step, limit);
  const found = await page.evaluate((was) => {
    const list: { id: number; z: number; at: [number, number] }[] = [];
    was.forEach((old, k) => {
      const at = window.soda.screenPosition(k + 1);
      const now = window.soda.bodyPosition(k + 1);
      if (!old || !now || !at || Math.hypot(now[0] - old[0], now[1] - old[1], now[2] - old[2]) > 0.002) return;
      if (document.elementFromPoint(at[0], at[1])?.id === 'view') list.push({ id: k + 1, z: now[2], at });
    });
    return list.sort((a, b) => b.z - a.z);
  }, earlier);
  for (const { id, at } of found) {
    await page.mouse.click(at[0], at[1]);
    const selected = await page.evaluate(() => document.querySelector('#inspector:not([hidden]) h2')?.textContent);
    if (selected === `Body ${id}`) yield { id, at };
  }
}

describe('the page and a session', { skip: lacks ?? false }, () => {
  const session = new LiveSession();
  let browser: Browser;
  let page: Page;
  const problems: string[] = [];

  before(async () => {
    await session.start('city', bodies, 4);
    browser = await startBrowser();
    page = await open(browser, session.url, problems);
  });
  after(async () => {
    await browser?.close();
    await session.stop();
  });

  test('shows all bodies and all worlds, and time goes on', async () => {
    const { worlds } = await session.status();
    assert.equal(worlds.world.length, 4);
    assert.equal(worlds.world.reduce((sum, w) => sum + Number(w.bodies), 0), bodies);
    assert.equal(await page.evaluate(() => window.soda.bodiesDrawn()), bodies);
    assert.equal(await page.evaluate(() => window.soda.staticTriangles()), 12, 'the ground is a box');
    assert.equal((await positions(page)).filter((p) => p !== null).length, bodies);
    await page.waitForFunction((text) => document.querySelector('.panel-head')?.textContent === text, `4 worlds · ${bodies} bodies`, limit);
    assert.deepEqual(await page.locator('#panel .card .name').allInnerTexts(), ['world 0', 'world 1', 'world 2', 'world 3']);
    assert.equal(await page.locator('#timeline .row-name').count(), 4);
    await page.waitForFunction(() => [...document.querySelectorAll('#panel .badge')].every((b) => b.textContent === 'running'), null, limit);
    const step = await page.evaluate(() => window.soda.step());
    await page.waitForFunction((s) => window.soda.step() > s + 20, step, limit);
    assert.ok(await page.evaluate(() => window.soda.mayAct() && window.soda.connected()));
  });

  test('a drag lifts the body, and what it rolls back is told as mine', async () => {
    // Lines of the ticker make room for others soon.
    await page.evaluate(() => {
      const seen: string[] = [];
      Object.assign(window, { mine: seen });
      new MutationObserver((changes) => {
        for (const { addedNodes } of changes)
          for (const line of addedNodes) if (line instanceof HTMLElement && line.matches('.mine')) seen.push(line.innerText);
      }).observe(document.querySelector('#ticker')!, { childList: true });
    });
    const mine = () => page.evaluate(() => (window as unknown as { mine: string[] }).mine);
    const { value } = await reachable(page).next();
    assert.ok(value, 'no body is within reach of the pointer');
    const { id, at } = value;
    const before = await position(page, id);
    const rollbacks = await page.evaluate(() => window.soda.rollbacks.length);
    await page.keyboard.down('Control');
    await page.mouse.move(at[0], at[1]);
    await page.mouse.down();
    for (let k = 1; k <= 8; k++) await page.mouse.move(at[0], at[1] - 10 * k);
    // Gravity would never do that.
    await page.waitForFunction(([i, z]) => window.soda.bodyPosition(i!)![2] > z! + 0.5, [id, before[2]], limit);
    const held = await page.evaluate((i) => window.soda.screenPosition(i)!, id);
    await page.mouse.up();
    await page.keyboard.up('Control');
    assert.equal(await page.locator('#inspector h2').innerText(), `Body ${id}`);
    const [dx, dy] = [held[0] - at[0], held[1] - at[1]];
    assert.ok(dy < -8 && Math.abs(dx) < -dy / 2, `dragged upwards, it went by ${dx}, ${dy} pixels`);
    await page.waitForFunction(() => window.soda.answers.some((a) => a.asked === 'release' && a.accepted), null, limit);
    const answers = await page.evaluate(() => window.soda.answers.map(({ asked, accepted, reason }) => ({ asked, accepted, reason })));
    assert.deepEqual(answers.filter((a) => !a.accepted), []);
    assert.ok(answers.some((a) => a.asked === 'grab') && answers.some((a) => a.asked === 'move'));
    await page.waitForFunction((n) => window.soda.rollbacks.length > n, rollbacks, limit);
    assert.ok(await page.evaluate((n) => window.soda.rollbacks.slice(n).every((r) => r.steps > 0 && r.bodies > 0), rollbacks));
    await page.waitForFunction(
      () => (window as unknown as { mine: string[] }).mine.some((line) => /^for your (grab|release), world \d did \d+ steps? again/.test(line)),
      null, limit).catch(async () => assert.fail(`the ticker said: ${JSON.stringify(await mine())}`));
    assert.ok((await mine()).some((line) => line.startsWith('your grab: done at step ')));
  });

  test('the timeline drawn into the future shows it, and returns', async () => {
    const handle = (await page.locator('#timeline .handle').boundingBox())!;
    const track = (await page.locator('#timeline .track').boundingBox())!;
    const x = handle.x + handle.width / 2;
    const y = track.y + track.height / 2;
    await page.mouse.move(x, y);
    await page.mouse.down();
    for (const share of [0.2, 0.4, 0.6, 1]) await page.mouse.move(x + share * (track.x + track.width - 2 - x), y);
    const seen = await page.waitForFunction(() => {
      const final = Math.min(...window.soda.worlds().map((w) => (w as { final: number }).final));
      const state = document.querySelector('.state')?.textContent ?? '';
      const now = { step: window.soda.step(), displayed: window.soda.displayed(), final, state, drawn: window.soda.bodiesDrawn() };
      return now.step > final && window.soda.anticipated() && state.startsWith('anticipated') && now;
    }, null, limit);
    await page.mouse.up();
    const now = await seen.jsonValue();
    assert.ok(now && now.step > now.final && now.step > now.displayed, JSON.stringify(now));
    assert.match(now.state, /^anticipated: \+\d+ steps, may still change$/);
    assert.equal(now.drawn, bodies);
    await page.keyboard.press('l');
    await page.waitForFunction(
      () => !window.soda.anticipated() && window.soda.step() <= window.soda.displayed() && document.querySelector<HTMLButtonElement>('button.live')!.disabled,
      null, limit);
    assert.doesNotMatch(await page.locator('.state').innerText(), /anticipated|ahead|past/);
  });

  test('pauses everywhere, does one step, resumes', async () => {
    assert.equal((await session.status()).clocks.paused, false);
    await page.keyboard.press(' ');
    const at = await pausedStep(page);
    // A second passes while it measures.
    const first = await session.status();
    assert.deepEqual([first.clocks.paused, Number(first.clocks.displayed)], [true, at]);
    assert.deepEqual(await page.evaluate(() => [window.soda.displayed(), window.soda.step()]), [at, at]);
    assert.equal(await page.locator('.state').innerText(), 'paused');
    await page.keyboard.press('.');
    await page.waitForFunction((s) => window.soda.displayed() > s && window.soda.step() > s, at, limit);
    const second = await session.status();
    assert.deepEqual([second.clocks.paused, Number(second.clocks.displayed)], [true, at + 1]);
    assert.deepEqual(await page.evaluate(() => [window.soda.displayed(), window.soda.step()]), [at + 1, at + 1]);
    await page.keyboard.press(' ');
    await page.waitForFunction((s) => window.soda.step() > s + 30, at, limit);
    assert.equal((await session.status()).clocks.paused, false);
  });

  test('who comes late sees the same', async () => {
    // The beginning is not even in the gateway's history any more.
    await page.waitForFunction(() => window.soda.displayed() > 400, null, { timeout: 120_000 });
    const late = await open(browser, session.url, problems);
    assert.equal(await late.evaluate(() => window.soda.bodiesDrawn()), bodies);
    const from = await late.evaluate(() => window.soda.step());
    assert.ok(from > 400, `it has seen step ${from}`);
    await late.waitForFunction((s) => window.soda.step() > s + 10, from, limit);
    await late.keyboard.press(' ');
    const step = await pausedStep(page);
    assert.equal(await pausedStep(late), step);
    const [here, there] = [await positions(page), await positions(late)];
    assert.equal(there.filter((p) => p !== null).length, bodies);
    here.forEach((p, k) => assert.ok(distance(p!, there[k]!) < 1e-4, `body ${k + 1}: ${p} and ${there[k]}`));
    await late.keyboard.press(' ');
    await page.waitForFunction((s) => window.soda.step() > s, step, limit);
    await late.context().close();
  });

  test('without the token one may look, and is refused what one asks for anyhow', async () => {
    const watcher = await open(browser, session.watchUrl, problems);
    assert.equal(await watcher.evaluate(() => window.soda.mayAct()), false);
    assert.equal(await watcher.evaluate(() => window.soda.bodiesDrawn()), bodies);
    assert.equal(await watcher.locator('.rights').innerText(), 'read-only');
    for (const name of [/^Grab/, /^Push/, /^Add a body/, /^Pause$/]) {
      const button = watcher.getByRole('button', { name });
      assert.ok(await button.isDisabled(), String(name));
      assert.match((await button.getAttribute('title'))!, /no token/);
    }
    await watcher.context().close();

    const { value } = await reachable(page).next();
    assert.ok(value, 'no body is within reach of the pointer');
    const { id } = value;
    const mass = 700; // kg, more than any slab's
    const action = create(ActionSchema, {
      kind: { case: 'push', value: create(PushSchema, { body: BigInt(id), impulse: { x: 3 * mass, y: 0, z: 6 * mass } }) },
    });
    const before = await position(page, id);
    const watching = new Socket(session.watchUrl);
    await watching.open();
    for (const what of [{ case: 'action', value: action }, { case: 'pause', value: true }, { case: 'speed', value: 0.5 }] as const) {
      const answer = await watching.ask(what);
      assert.equal(answer.accepted, false, what.case);
      assert.match(answer.reason, /may only watch/);
    }
    assert.equal(watching.mayAct, false);
    watching.close();
    const step = await page.evaluate(() => window.soda.step());
    await page.waitForFunction((s) => window.soda.step() > s + 30, step, limit);
    assert.ok(distance(before, await position(page, id)) < 0.02, 'it was pushed all the same');

    // It is the token that makes the difference.
    const acting = new Socket(session.url);
    await acting.open();
    assert.equal((await acting.ask({ case: 'action', value: action })).accepted, true);
    acting.close();
    await page.waitForFunction(([i, x]) => Math.abs(window.soda.bodyPosition(i!)![0] - x!) > 0.5, [id, before[0]], limit);
  });

  test('says nothing bad in the console', () => assert.deepEqual(bad(problems), []));
});

describe('the page and a world that dies', { skip: lacks ?? false }, () => {
  const session = new LiveSession();
  let browser: Browser;
  after(async () => {
    await browser?.close();
    await session.stop();
  });

  test('says which world is silent, and that the session has failed', async () => {
    const problems: string[] = [];
    await session.start('city', bodies, 3);
    browser = await startBrowser();
    const page = await open(browser, session.url, problems);
    await page.waitForFunction(() => [...document.querySelectorAll('#panel .badge')].every((b) => b.textContent === 'running'), null, limit);
    const { pid } = (await session.status()).worlds.world[2]!;
    // First it hangs: the others are there and say so. When it is killed, `soda run` ends them, too.
    process.kill(pid, 'SIGSTOP');
    await page.waitForFunction(() => document.querySelectorAll('#panel .badge')[2]?.textContent === 'silent', null, limit);
    await page.waitForFunction(() => document.querySelectorAll('.row-name')[2]?.textContent === 'world 2 · silent', null, limit);
    assert.match(await page.locator('.trouble').innerText(), /world 2: silent/);
    // On a machine with too much to do these, too, are silent for a moment now and then.
    await page.waitForFunction(() => [...document.querySelectorAll('#panel .badge')].map((b) => b.textContent).join() === 'running,running,silent', null, limit);
    assert.ok(await page.locator('#banner').isHidden());
    process.kill(pid, 'SIGKILL');
    const { code, output } = await session.ended();
    assert.equal(code, 1);
    assert.match(output, /world 2 was killed by signal 9/);
    // Worlds that are ended so may have no time to say it; then all are silent, and that is said.
    await page.waitForFunction(() => document.querySelector('#banner:not([hidden])'), null, limit);
    assert.equal(await page.locator('#banner h2').innerText(), 'The session has failed');
    assert.equal(await page.locator('#banner').getAttribute('data-kind'), 'bad');
    assert.equal(await page.evaluate(() => window.soda.bodiesDrawn()), bodies, 'what was there last is not shown any more');
    assert.deepEqual(bad(problems), []);
  });
});
