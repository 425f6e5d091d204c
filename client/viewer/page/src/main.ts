// The page: brings together what is told (net, model), what is drawn (draw), what is done (act) and what is read (ui).
import './style/index.css';
import { Tools } from './act/tools';
import { expose, type Rates } from './debug';
import { Picture } from './draw/picture';
import { Link } from './link';
import { Looking } from './model/look';
import { Session } from './model/session';
import { Connection, gatewayUrl } from './net/connection';
import { Requests } from './net/requests';
import { QualityChooser } from './quality';
import { colourModes, SettingsStore } from './settings';
import { Banner, toast } from './ui/banner';
import { Bar } from './ui/bar';
import { helpDialog, settingsDialog } from './ui/dialogs';
import { byId } from './ui/dom';
import { Inspector } from './ui/inspector';
import { listenToKeys } from './ui/keys';
import { drawLegend } from './ui/legend';
import { Ticker } from './ui/ticker';
import { Timeline } from './ui/timeline';
import { Toolbar } from './ui/toolbar';
import { WorldsPanel } from './ui/worlds';
import { create } from '@bufbuild/protobuf';
import { ShownSchema } from './gen/viewer_pb';

const seconds = () => performance.now() / 1000;
const toasts = byId('toasts');
const say = (text: string, kind: 'info' | 'bad' = 'info') => toast(toasts, text, kind);

const settings = new SettingsStore();
const link: Link = new Link(
  settings,
  () => picture.views.state(),
  (camera) => picture.views.restore(camera),
);
const picture: Picture = new Picture(byId<HTMLCanvasElement>('view'), byId('labels'), settings, () => link.changed());
const ticker = new Ticker(byId('ticker'));

// ---- what the gateway tells --------------------------------------------------------------------------------------------

let framesTaken: number | null = null; // number of the newest frame that was not confirmed yet

const session: Session = new Session({
  welcome(welcome) {
    connection.expectMore(true); // a session may follow one that has ended
    banner.update();
    picture.begin(welcome, link.camera !== null);
    if (link.camera) picture.views.restore(link.camera);
    link.camera = null;
    worldsPanel.clear();
    worldsPanel.update(seconds());
    tools.select(-1);
    bar.show();
    toolbar.update();
    legend();
    looking.again();
  },
  bodies: (list) => picture.addBodies(list),
  transfers: (list) => picture.addTransfers(list),
  frame(frame) {
    picture.takeFrame(frame, seconds());
    framesTaken = frame.number;
  },
  clocks() {
    if (session.clocks && !session.clocks.paused) picture.playback?.pacer.expect(session.clocks.speed / (session.welcome?.dt || 1 / 60));
    timeline.update();
  },
  worlds() {
    worldsPanel.update(seconds());
    bar.showTrouble(
      session.worlds.flatMap((_, w) => {
        const trouble = worldsPanel.trouble(w);
        return trouble ? [`world ${w}: ${trouble.short}`] : [];
      }),
    );
  },
  rollback: (record) => ticker.rolledBack(record, record.at),
  ended() {
    connection.expectMore(false);
    toolbar.update();
    banner.update();
    timeline.update();
  },
  said(text) {
    ticker.said(text);
    say(text);
  },
});

const connection: Connection = new Connection(
  gatewayUrl(link.token),
  (message) => {
    if (message.what.case === 'answer') requests.answered(message.what.value);
    else session.take(message, seconds());
  },
  (state) => {
    if (state.kind !== 'open') {
      requests.lost();
      framesTaken = null;
    }
    banner.update();
  },
);

const requests = new Requests(
  () => connection,
  (record) => {
    ticker.answered(record, seconds());
    if (!record.accepted) say(`Refused: ${record.asked}: ${record.reason}`, 'bad');
  },
);

const looking: Looking = new Looking(
  (what) => {
    picture.playback?.expectJump(seconds());
    connection.send(what);
  },
  () => timeline.update(),
);

// ---- what the user may do ----------------------------------------------------------------------------------------------

const mayAct = () => session.mayAct && connection.state.kind === 'open';
function whyNot(): string {
  if (session.ended) return 'The session has ended.';
  if (connection.state.kind !== 'open') return 'There is no connection.';
  if (session.welcome?.replay) return 'This is a recording: what happened cannot be changed.';
  return 'This link is for looking only: it has no token.';
}

const tools = new Tools(
  byId<HTMLCanvasElement>('view'),
  picture.stage,
  picture.views,
  picture.bodies,
  picture.picker,
  picture.marks,
  requests,
  settings,
  {
    mayAct,
    whyNot,
    say,
    selected: (body) => inspector.update(body),
    toolChanged: (tool) => toolbar.setTool(tool),
  },
);

function follow(): void {
  const body = picture.marks.selected;
  if (picture.views.following !== null) picture.views.follow(null);
  else if (body >= 0) picture.views.follow(body);
  else say('Click on a body first, then follow it.');
}

const inspector = new Inspector(byId('inspector'), picture.bodies, {
  follow,
  remove: () => tools.removeSelected(),
  close: () => tools.select(-1),
  following: () => picture.views.following !== null,
  mayAct,
  whyNot,
});

const toolbar = new Toolbar(byId('tools'), settings, {
  choose: (tool) => tools.choose(tool),
  mayAct,
  whyNot,
  follow,
  home: () => picture.views.frameAll(),
  spawnHere: () => tools.spawn(),
});

const worldsPanel = new WorldsPanel(byId('panel'), session);

const timeline: Timeline = new Timeline(byId('timeline'), session, looking, {
  pause: (on) => void requests.ask({ case: on ? 'pause' : 'resume', value: true }),
  stepOnce: () => void requests.ask({ case: 'steps', value: 1n }),
  speed: (multiple) => void requests.ask({ case: 'speed', value: multiple }),
  seek: (step) => {
    picture.playback?.expectJump(seconds());
    void requests.ask({ case: 'seek', value: BigInt(step) });
  },
  trouble: (world) => worldsPanel.trouble(world),
  shown: () => picture.playback?.step() ?? 0,
  anticipated: () => picture.playback?.anticipated ?? false,
  whyNoPace: whyNot,
});

// ---- the page itself ---------------------------------------------------------------------------------------------------

const systemDark = matchMedia('(prefers-color-scheme: dark)');
const dark = () => (settings.now.theme === 'auto' ? systemDark.matches : settings.now.theme === 'dark');

function showTheme(): void {
  document.documentElement.dataset.theme = dark() ? 'dark' : 'light';
  picture.setTheme(dark());
  bar.show();
  timeline.update();
}

async function copyLink(withToken: boolean): Promise<void> {
  const url = link.url(withToken);
  try {
    await navigator.clipboard.writeText(url);
    say(withToken ? 'Copied, with the right to act.' : 'Copied. Who opens it sees this view, and cannot act.');
  } catch {
    // Browsers have a clipboard for secure pages only; a gateway on another host is none.
    prompt('The link to this view:', url);
  }
}

function screenshot(): void {
  picture.draw(seconds()); // what was drawn before is gone once it was shown
  byId<HTMLCanvasElement>('view').toBlob((blob) => {
    if (!blob) return;
    const anchor = document.createElement('a');
    anchor.href = URL.createObjectURL(blob);
    anchor.download = `soda-${session.welcome?.session ?? 'scene'}-${picture.playback?.step() ?? 0}.png`;
    anchor.click();
    setTimeout(() => URL.revokeObjectURL(anchor.href), 1000);
  }, 'image/png');
}

const quality = new QualityChooser(settings, picture.stage.software, (level) => picture.setLevel(level));
const showHelp = helpDialog();
const showSettings = settingsDialog(settings, {
  quality: () => quality.level,
  copyLink: (withToken) => void copyLink(withToken),
  hasToken: () => link.token !== null,
});
const bar = new Bar(byId('bar'), session, settings, {
  screenshot,
  copyLink: () => void copyLink(false),
  settings: showSettings,
  help: showHelp,
  dark,
});
const banner = new Banner(byId('banner'), session, { reconnect: () => connection.open(), link: () => connection.state });

const legend = () => drawLegend(byId('legend'), settings.now, session.welcome?.worlds ?? 0, picture.colours.topSpeed);

function showSettingsOnPage(): void {
  document.body.classList.toggle('no-panel', !settings.now.panel);
  byId('ticker').hidden = !settings.now.ticker;
  legend();
}

settings.onChange((_, key) => {
  if (key === 'theme') showTheme();
  showSettingsOnPage();
});
systemDark.addEventListener('change', showTheme);

listenToKeys({
  ' ': () => session.mayPace && timeline.togglePause(),
  '.': () => session.mayPace && session.clocks?.paused && void requests.ask({ case: 'steps', value: 1n }),
  ArrowLeft: (event) => timeline.scrub(event.shiftKey ? -10 : -1),
  ArrowRight: (event) => timeline.scrub(event.shiftKey ? 10 : 1),
  l: () => timeline.goLive(),
  k: () => timeline.toggleHold(),
  c: () => settings.set('colour', colourModes[(colourModes.indexOf(settings.now.colour) + 1) % colourModes.length]!),
  b: () => settings.toggle('borders'),
  n: () => settings.toggle('near'),
  m: () => settings.toggle('mixed'),
  r: () => settings.toggle('redone'),
  w: () => settings.toggle('panel'),
  t: () => bar.toggleTheme(),
  p: screenshot,
  ',': showSettings,
  '?': showHelp,
  h: showHelp,
  f: follow,
  Home: () => picture.views.frameAll(),
  Delete: () => tools.removeSelected(),
  Escape: () => (tools.tool !== 'select' ? tools.choose('select') : tools.select(-1)),
  '1': () => tools.choose('select'),
  '2': () => tools.choose('grab'),
  '3': () => tools.choose('push'),
  '4': () => tools.choose('spawn'),
});

// ---- pictures ----------------------------------------------------------------------------------------------------------

const rates: Rates = { fps: 0, milliseconds: 0 };
let pictures = 0;
let busy = 0; // ms in this second
let since = performance.now();
let slowUiAt = 0;

function frame(): void {
  const begin = performance.now();
  tools.update();
  picture.draw(begin / 1000);
  // Told once a picture has been drawn since: a page that cannot keep up, or is hidden, is not sent more than it takes.
  if (framesTaken !== null) {
    connection.send({ case: 'shown', value: create(ShownSchema, { number: framesTaken }) });
    framesTaken = null;
  }
  if (begin - slowUiAt > 100) {
    slowUiAt = begin;
    inspector.update(picture.marks.selected);
    toolbar.update();
    banner.update();
  }
  const end = performance.now();
  pictures++;
  busy += end - begin;
  if (end - since >= 1000) {
    rates.fps = (1000 * pictures) / (end - since);
    rates.milliseconds = busy / pictures;
    pictures = busy = 0;
    since = end;
    bar.showRate(rates.fps, picture.instances.drawn);
    quality.measured(rates.fps);
    if (picture.measureSpeeds()) legend();
  }
  requestAnimationFrame(frame);
}

expose(picture, session, requests, rates, () => connection.state.kind === 'open');
showTheme();
showSettingsOnPage();
connection.open();
requestAnimationFrame(frame);
