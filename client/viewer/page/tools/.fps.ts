import { openPage, startBrowser, startMock } from './browser';
const [hash, mockArgs, secs, w, h] = process.argv.slice(2);
const port = 8900 + Math.floor(Math.random()*90);
const mock = await startMock(port, (mockArgs||'').split(' ').filter(Boolean));
const browser = await startBrowser();
const problems: string[] = [];
const page = await openPage(browser, `http://127.0.0.1:${port}/?token=mock#${hash}`, +(w||1000), +(h||640), true, problems);
for (let k=0;k<+(secs||30)/5;k++){ await page.waitForTimeout(5000); console.log(JSON.stringify(await page.evaluate(()=>({fps:soda.fps().toFixed(2),ms:soda.frameMilliseconds().toFixed(2),drawn:soda.bodiesDrawn(),step:soda.step(),d:soda.displayed()}))));}
await browser.close(); mock.kill(); console.log(problems.join('\n'));
