// How smooth a page is, and how old what it shows: `npm run fps -- --url URL [--seconds S] [--quality Q]`. For
// soda-bench viewer, which reads the line that it prints.
import { parseArgs } from 'node:util';
import { openPage, startBrowser } from './browser';

const { values } = parseArgs({
  options: {
    url: { type: 'string' },
    seconds: { type: 'string', default: '10' },
    quality: { type: 'string', default: 'low' },
  },
});
if (!values.url) throw new Error('--url is needed');
const browser = await startBrowser();
const problems: string[] = [];
try {
  const page = await openPage(browser, `${values.url}#quality=${values.quality}`, 1280, 720, true, problems);
  await page.waitForTimeout(3000); // until scripts are compiled and the pace is known
  const samples: { fps: number; script: number; delay: number }[] = [];
  for (let k = 0; k < 2 * Number(values.seconds); k++) {
    await page.waitForTimeout(500);
    samples.push(
      await page.evaluate(() => ({ fps: window.soda.fps(), script: window.soda.frameMilliseconds(), delay: window.soda.delayMilliseconds() })),
    );
  }
  const median = (of: (s: (typeof samples)[0]) => number) => samples.map(of).sort((a, b) => a - b)[samples.length >> 1]!;
  console.log(`fps ${median((s) => s.fps)} script_ms ${median((s) => s.script)} delay_ms ${median((s) => s.delay)} done`);
} finally {
  await browser.close();
}
for (const problem of new Set(problems)) console.error(problem);
