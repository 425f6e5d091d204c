// The built page in a browser, against the mock gateway. Needs `npm run build` before, and chromium; without it, these
// are skipped. Nothing here depends on how fast pictures come: software draws few of them.
import assert from 'node:assert/strict';
import type { ChildProcess } from 'node:child_process';
import { existsSync } from 'node:fs';
import { after, before, describe, test } from 'node:test';
import type { Browser, Page } from 'playwright-core';
import { openPage, startBrowser, startMock } from '../tools/browser';

const chromium = process.env.CHROMIUM ?? '/usr/bin/chromium';
const port = 8300 + (process.pid % 300);
const base = `http://127.0.0.1:${port}/`;
const limit = { timeout: 60_000 };

describe('the page', { skip: existsSync(chromium) ? false : 'there is no chromium' }, () => {
  let mock: ChildProcess;
  let browser: Browser;
  let page: Page;
  const problems: string[] = [];

  before(async () => {
    mock = await startMock(port, ['--bodies', '300', '--worlds', '3', '--balance']);
    browser = await startBrowser();
    page = await openPage(browser, `${base}?token=mock#quality=minimal&show=b`, 1000, 640, true, problems, 100);
  });
  after(async () => {
    await browser?.close();
    mock?.kill();
  });
  const state = () => page.locator('.state').innerText();
  const told = (text: string) => page.waitForFunction((t) => document.querySelector('.state')?.textContent?.includes(t), text, limit);
  const pause = async () => {
    await page.keyboard.press(' ');
    await page.waitForFunction(() => document.querySelector('[aria-label="Resume"]'), null, limit);
  };
  const resume = async () => {
    await page.keyboard.press(' ');
    await page.waitForFunction(() => document.querySelector('[aria-label="Pause"]'), null, limit);
  };

  test('draws all bodies, and time goes on', async () => {
    assert.equal(await page.evaluate(() => window.soda.bodiesDrawn()), 300);
    const step = await page.evaluate(() => window.soda.step());
    await page.waitForFunction((s) => window.soda.step() > s + 20, step, limit);
    assert.equal(await page.evaluate(() => window.soda.worlds().length), 3);
    assert.ok(await page.evaluate(() => window.soda.mayAct() && window.soda.connected()));
  });

  test('shows the future as such, the past as such, and returns', async () => {
    for (let k = 0; k < 2; k++) await page.keyboard.press('Shift+ArrowRight');
    await told('anticipated: +20 steps, may still change');
    await page.waitForFunction(() => window.soda.anticipated() && window.soda.step() > window.soda.displayed(), null, limit);
    for (let k = 0; k < 4; k++) await page.keyboard.press('Shift+ArrowLeft');
    await told('past: −20 steps');
    await page.waitForFunction(() => window.soda.step() < window.soda.displayed(), null, limit);
    await page.keyboard.press('l');
    await told('live');
  });

  test('shows the territories of the step that is shown', async () => {
    const cells = () => page.evaluate(() => window.soda.cells());
    const shows = (offset: number) =>
      page.waitForFunction((by) => window.soda.step() === window.soda.displayed() + by, offset, limit);
    await page.waitForFunction(() => window.soda.displayed() > 200, null, limit);
    await pause();
    await shows(0);
    const now = await cells();
    for (let k = 0; k < 6; k++) await page.keyboard.press('Shift+ArrowLeft');
    await shows(-60);
    const before = await cells(); // one transfer earlier
    assert.notDeepEqual(before, now);
    assert.equal(before.reduce((a, b) => a + b), now.reduce((a, b) => a + b));
    await page.keyboard.press('l');
    await shows(0);
    assert.deepEqual(await cells(), now);
    await resume();
    // A page that comes later is told what has changed hands before.
    const late = await openPage(browser, `${base}#quality=minimal`, 600, 400, true, problems, 100);
    await pause();
    await shows(0);
    await late.waitForFunction(() => window.soda.step() === window.soda.displayed(), null, limit);
    const [here, there] = [await cells(), await late.evaluate(() => window.soda.cells())];
    assert.deepEqual(there, here);
    await late.context().close();
    await resume();
  });

  test('pauses, does one step, resumes', async () => {
    await pause();
    const before = await page.evaluate(() => window.soda.displayed());
    await page.keyboard.press('.');
    await page.waitForFunction((s) => window.soda.displayed() === s + 1, before, limit);
    await page.waitForFunction((s) => window.soda.step() === s + 1, before, limit);
    await resume();
    assert.match(await state(), /live/);
  });

  test('pushes what is clicked on, and tells the rollback', async () => {
    await page.keyboard.press('3');
    const rollbacks = await page.evaluate(() => window.soda.rollbacks.length);
    await pause(); // or it might have gone when the click comes
    await page.waitForFunction(() => window.soda.step() === window.soda.displayed(), null, limit);
    const at = await page.evaluate(() => {
      for (let y = 200; y < 450; y += 5) for (let x = 300; x < 600; x += 5) if (window.soda.bodyAt(x, y) !== null) return [x, y] as const;
      return null;
    });
    assert.ok(at, 'there is no body in the middle of the picture');
    await page.mouse.click(...at);
    await page.waitForFunction(() => window.soda.answers.some((a) => a.asked === 'push' && a.accepted), null, limit);
    await page.waitForFunction((n) => window.soda.rollbacks.length > n, rollbacks, limit);
    await page.waitForFunction(() => document.querySelector('#ticker .mine'), null, limit);
    await page.keyboard.press('1');
    await resume();
  });

  test('adds a body, grabs it, and removes it', async () => {
    await page.evaluate(() => {
      for (const button of document.querySelectorAll<HTMLButtonElement>('#tools button'))
        if (button.ariaLabel?.startsWith('Add')) button.click();
    });
    await pause(); // the mock's bodies fall through each other: soon it would be inside another
    await page.getByRole('button', { name: 'Add in front of me' }).click();
    await page.waitForFunction(() => window.soda.answers.some((a) => a.asked === 'spawn' && a.accepted), null, limit);
    const step = await page.evaluate(() => Number(window.soda.answers.find((a) => a.asked === 'spawn')!.step));
    for (let now = await page.evaluate(() => window.soda.displayed()); now < step; now++) {
      await page.keyboard.press('.');
      await page.waitForFunction((s) => window.soda.displayed() === s && window.soda.step() === s, now + 1, limit);
    }
    await page.waitForFunction(() => window.soda.bodiesDrawn() === 301, null, limit);
    await page.keyboard.press('1');
    const at = await page.evaluate(() => {
      const [x, y] = window.soda.screenPosition(301)!;
      for (let d = 0; d < 30; d++)
        for (const p of [[x, y - d], [x, y + d], [x - d, y], [x + d, y]] as const) if (window.soda.bodyAt(...p) === 301n) return p;
      return null;
    });
    assert.ok(at, 'what was added is out of sight');
    await page.keyboard.down('Control');
    await page.mouse.move(at[0], at[1]);
    await page.mouse.down();
    for (let k = 1; k <= 6; k++) await page.mouse.move(at[0] + 8 * k, at[1] - 8 * k);
    await page.waitForFunction(() => window.soda.answers.some((a) => a.asked === 'move' && a.accepted), null, limit);
    await page.mouse.up();
    await page.keyboard.up('Control');
    await page.waitForFunction(() => window.soda.answers.some((a) => a.asked === 'release' && a.accepted), null, limit);
    assert.equal(await page.locator('#inspector h2').innerText(), 'Body 301');
    await resume();
    await page.keyboard.press('Delete');
    await page.waitForFunction(() => window.soda.bodiesDrawn() === 300, null, limit);
  });

  test('a link without a token can look, and says why it cannot act', async () => {
    const other = await openPage(browser, `${base}#quality=minimal`, 800, 500, false, problems, 100);
    assert.equal(await other.evaluate(() => window.soda.mayAct()), false);
    const grab = other.getByRole('button', { name: /^Grab/ });
    // What it may do is shown with the next picture.
    await other.waitForFunction(() => document.querySelector<HTMLButtonElement>('#tools button[aria-label^="Grab"]')?.disabled, null, limit);
    assert.match((await grab.getAttribute('title'))!, /no token/);
    await other.close();
  });

  test('has its layout before anything is told', async () => {
    const mute = await startMock(port + 300, ['--mute']);
    const context = await browser.newContext({ viewport: { width: 1280, height: 800 } });
    const page = await context.newPage();
    await page.goto(`http://127.0.0.1:${port + 300}/#quality=minimal`);
    await page.waitForFunction(() => window.soda, null, limit);
    const height = await page.evaluate(() => document.querySelector('#view')!.getBoundingClientRect().height);
    mute.kill();
    assert.ok(height > 500, `the scene's part is ${height} pixels high`);
    await context.close();
  });

  test('connects again when the gateway comes back, and the scene is whole', async () => {
    mock.kill();
    await page.waitForFunction(() => !window.soda.connected(), null, limit);
    await page.waitForFunction(() => document.querySelector('#banner:not([hidden])')?.textContent?.includes('Next try in'), null, limit);
    mock = await startMock(port, ['--bodies', '200', '--worlds', '2']);
    await page.waitForFunction(() => window.soda.connected() && window.soda.bodiesDrawn() === 200, null, limit);
    assert.ok(await page.locator('#banner').isHidden());
  });

  test('says nothing bad in the console but the broken connection', () => {
    assert.deepEqual(problems.filter((p) => !p.includes('WebSocket') && !p.includes('GPU stall')), []);
  });
});
