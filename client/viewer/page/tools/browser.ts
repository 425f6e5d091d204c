// For tools that look at the page: the mock gateway as a process, and Debian's chromium without a window, which draws
// WebGL in software.
import { spawn, type ChildProcess } from 'node:child_process';
import { dirname, join } from 'node:path';
import { fileURLToPath } from 'node:url';
import { chromium, type Browser, type Page } from 'playwright-core';

const root = dirname(dirname(fileURLToPath(import.meta.url)));

export async function startMock(port: number, args: string[]): Promise<ChildProcess> {
  const child = spawn(process.execPath, [join(root, 'node_modules/tsx/dist/cli.mjs'), join(root, 'tools/mock.ts'), '--port', String(port), ...args], {
    stdio: ['ignore', 'pipe', 'inherit'],
  });
  await new Promise<void>((resolve, reject) => {
    child.stdout!.on('data', () => resolve());
    child.on('exit', (code) => reject(new Error(`the mock ended with ${code}`)));
  });
  return child;
}

export async function startBrowser(): Promise<Browser> {
  return chromium.launch({
    executablePath: process.env.CHROMIUM ?? '/usr/bin/chromium',
    args: ['--no-sandbox', '--use-gl=angle', '--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--ignore-gpu-blocklist', '--hide-scrollbars'],
  });
}

// A page that says what went wrong in it. `pause`: ms between pictures; software is then not always behind with drawing,
// and the rest of the page stays quick.
export async function openPage(
  browser: Browser, url: string, width: number, height: number, dark: boolean, problems: string[], pause = 0,
): Promise<Page> {
  const context = await browser.newContext({ viewport: { width, height }, colorScheme: dark ? 'dark' : 'light' });
  const page = await context.newPage();
  page.setDefaultTimeout(60_000);
  if (pause > 0)
    await page.addInitScript((ms) => {
      const native = window.requestAnimationFrame.bind(window);
      window.requestAnimationFrame = (draw) => window.setTimeout(() => native(draw), ms);
    }, pause);
  page.on('console', (message) => {
    if (message.type() === 'error' || message.type() === 'warning') problems.push(`${message.type()}: ${message.text()}`);
  });
  page.on('pageerror', (error) => problems.push(`exception: ${error.message}\n${error.stack}`));
  await page.goto(url);
  // Asked at times, not with each picture: a page that draws none should be able to say so.
  await page.waitForFunction(() => window.soda?.bodiesDrawn() > 0, null, { timeout: 240_000, polling: 200 }).catch(async (error: Error) => {
    const asked = page.evaluate(() => ({
      page: document.visibilityState, banner: document.querySelector('#banner:not([hidden])')?.textContent, fps: window.soda?.fps(),
      connected: window.soda?.connected(), worlds: window.soda?.worlds().length, drawn: window.soda?.bodiesDrawn(),
    }));
    const state = await Promise.race([asked, new Promise((resolve) => setTimeout(resolve, 20_000, 'it does not answer'))]);
    throw new Error(`nothing is drawn: ${JSON.stringify(state)}; ${problems.join('\n')}`, { cause: error });
  });
  return page;
}
