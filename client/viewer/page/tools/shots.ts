// Pictures of the page for people to look at: `npm run shots -- --out DIR [--url URL] [--hash HASH] [--light] ...`.
import { mkdirSync } from 'node:fs';
import { join } from 'node:path';
import { parseArgs } from 'node:util';
import { openPage, startBrowser, startMock } from './browser';

const { values } = parseArgs({
  options: {
    out: { type: 'string', default: '/tmp/soda-shots' },
    name: { type: 'string', default: 'page' },
    mock: { type: 'string', default: '' }, // arguments of the mock
    url: { type: 'string' }, // of a gateway, instead of a mock
    hash: { type: 'string', default: 'quality=high' },
    keys: { type: 'string', default: '' }, // to press, one after the other
    light: { type: 'boolean', default: false },
    width: { type: 'string', default: '1440' },
    height: { type: 'string', default: '860' },
    wait: { type: 'string', default: '3' },
    pause: { type: 'string', default: '2000' }, // ms between pictures
    eval: { type: 'string' },
    step: { type: 'string', default: '0' }, // displayed, that is waited for before keys are pressed
    format: { type: 'string', default: 'png' }, // or jpeg
  },
});
const port = 8700 + Math.floor(Math.random() * 200);
const mock = values.url ? null : await startMock(port, values.mock.split(' ').filter(Boolean));
const browser = await startBrowser();
const problems: string[] = [];
try {
  const url = `${values.url ?? `http://127.0.0.1:${port}/?token=mock`}#${values.hash}`;
  const page = await openPage(browser, url, Number(values.width), Number(values.height), !values.light, problems, Number(values.pause));
  await page.waitForFunction((s) => window.soda.displayed() >= s, Number(values.step), { timeout: 280_000, polling: 200 });
  await page.waitForTimeout(1000);
  for (const key of values.keys.split(' ').filter(Boolean)) await page.keyboard.press(key);
  await page.waitForTimeout(1000 * Number(values.wait));
  if (values.eval) console.log(JSON.stringify(await page.evaluate(values.eval)));
  mkdirSync(values.out, { recursive: true });
  const format = values.format === 'jpeg' ? { type: 'jpeg' as const, quality: 86, path: join(values.out, `${values.name}.jpg`) } : { path: join(values.out, `${values.name}.png`) };
  await page.screenshot({ ...format, timeout: 280_000 });
  console.log(JSON.stringify(await page.evaluate(() => ({ fps: window.soda.fps(), ms: window.soda.frameMilliseconds(), drawn: window.soda.bodiesDrawn(), step: window.soda.step() }))));
} finally {
  await browser.close();
  mock?.kill();
}
for (const problem of new Set(problems)) console.log(problem);
