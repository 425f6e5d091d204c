// How smooth a page is, and how old what it shows: `npm run fps -- --url URL [--seconds S] [--quality Q]`. For
// soda-bench viewer, which reads the line that it prints.
import { parseArgs } from 'node:util';
import { openPage, startBrowser } from './browser';

const { values } = parseArgs({
  options: {
    url: { type: 'string' },
    seconds: { type: 'string', default: '10' },
    quality: { type: 'string', default: 'minimal' },
  },
});
if (!values.url) throw new Error('--url is needed');
const browser = await startBrowser();
const problems: string[] = [];
try {
  const page = await openPage(browser, `${values.url}#quality=${values.quality}`, 960, 540, true, problems);
  await page.waitForTimeout(3000); // until scripts are compiled and the pace is known
  // Gathered within the page: asking it from here would wait for pictures.
  const samples = await page.evaluate(
    (seconds) =>
      new Promise<{ fps: number; script: number; delay: number }[]>((resolve) => {
        const list: { fps: number; script: number; delay: number }[] = [];
        const timer = setInterval(
          () => list.push({ fps: window.soda.fps(), script: window.soda.frameMilliseconds(), delay: window.soda.delayMilliseconds() }), 500);
        setTimeout(() => {
          clearInterval(timer);
          resolve(list);
        }, 1000 * seconds);
      }),
    Number(values.seconds),
  );
  const median = (of: (s: (typeof samples)[0]) => number) => samples.map(of).sort((a, b) => a - b)[samples.length >> 1] ?? 0;
  console.log(`fps ${median((s) => s.fps)} script_ms ${median((s) => s.script)} delay_ms ${median((s) => s.delay)} done`);
} finally {
  await browser.close();
}
for (const problem of new Set(problems)) console.error(problem);
