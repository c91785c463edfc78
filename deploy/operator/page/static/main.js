/** Puts the page together: events of hands and server in, messages out, the newest state on the screen. */

import { Arm } from "./arm.js";
import { stayAwake } from "./awake.js";
import { Chain } from "./chain.js";
import { Connection } from "./connection.js";
import { byId, setAttributes } from "./dom.js";
import { Engines } from "./engines.js";
import { takeFaults } from "./faults.js";
import { listen } from "./hands.js";
import { PERIOD, RELEASED, step } from "./hold.js";
import { HoldButton } from "./hold_button.js";
import { Lines } from "./lines.js";
import { INITIAL, Model } from "./model.js";
import { Operator } from "./operator.js";
import { Processes } from "./processes.js";
import { Rewind } from "./rewind.js";
import { Sliders } from "./sliders.js";
import { SpeedPlot } from "./speed_plot.js";
import { Status } from "./status.js";
import { Timeline } from "./timeline.js";
import { takeToken } from "./token.js";

const SLOW_PERIOD = 200; // ms between drawings of chain, plots and sliders: a plot moves by a pixel
const CALM_PERIOD = 1000; // ms, the same where motion is reduced
const STATUS_PERIOD = 500; // ms between drawings without news: the age of the state grows

const calm = matchMedia("(prefers-reduced-motion: reduce)");

const connection = new Connection({
  welcome(message) {
    model.begin(message);
    lines.clear();
    setAttributes(document.documentElement, { "data-page": message.page });
  },
  update(message) {
    model.update(message);
    chain.note(model);
    rewind.note(model);
    feed({ type: "update", nonce: message.nonce });
    takeFaults().forEach((text) => connection.send({ type: "fault", text }));
  },
  refused: ({ request, why }) => refusals[request]?.(why),
  released: ({ why }) => feed({ type: "released", why }),
  changed() {
    if (connection.state !== "live") feed({ type: "disconnected" });
    invalidate();
  },
});
const send = (message) => connection.state === "live" && connection.send(message);

const model = new Model();
const status = new Status();
const holdButton = new HoldButton();
const operator = new Operator();
const engines = new Engines(send);
const chain = new Chain(send);
const arm = new Arm();
const rewind = new Rewind();
const plots = [new SpeedPlot(), new Timeline()];
const sliders = new Sliders(send);
const processes = new Processes(send);
const lines = new Lines();

const refusals = {
  press: (why) => feed({ type: "refused", why }),
  engines: (why) => engines.refuse(why),
  set: (why) => sliders.refuse(why),
  follow_scenario: (why) => sliders.refuse(why),
  process: (why) => [processes, chain].forEach((it) => it.refuse(why)),
};

let hold = RELEASED;
let isScheduled = false;
let drawn = -Infinity;
let drawnSlowly = -Infinity;
let wasLive = false;
let isReplay = false;

/** Step the hold; what it sends leaves at once. */
function feed(event) {
  const before = hold;
  const result = step(hold, { at: performance.now(), ...event });
  hold = result.state;
  result.send.forEach((message) => connection.send(message));
  if (hold.held !== before.held) stayAwake(hold.held);
  if (event.type === "update" || hold.held !== before.held || hold.why !== before.why) invalidate();
}

/** Draw the newest state with the next frame. */
function invalidate() {
  if (isScheduled) return;
  isScheduled = true;
  requestAnimationFrame(render);
}

function render(now) {
  isScheduled = false;
  drawn = now;
  const isLive = connection.state === "live";
  status.render(connection, model);
  holdButton.render(model, hold, isLive);
  const known = isLive ? model : { ...INITIAL, welcome: model.welcome };
  operator.render(known);
  engines.render(known, isLive, hold.held);
  rewind.allow(isLive && !hold.held && model.engines.state !== "on");
  const replay = rewind.frame(now);
  if (Boolean(replay) !== isReplay) arm.forget();
  isReplay = Boolean(replay);
  arm.render(replay ?? model, isLive);
  processes.render(known, isLive);
  lines.add(model.takeLines());
  if (now - drawnSlowly >= (calm.matches ? CALM_PERIOD : SLOW_PERIOD) || isLive !== wasLive) {
    drawnSlowly = now;
    chain.render(model, isLive);
    sliders.render(model, isLive, now);
    for (const plot of plots) plot.render(replay ?? model, isLive);
  }
  wasLive = isLive;
}

const pollGamepads = listen(
  byId("hold"),
  feed,
  () => hold.held,
  () => engines.command("turn_on"),
);

/** The beat: independent of drawing, on the main thread, so that a hung page falls silent. */
function tick() {
  const now = performance.now();
  pollGamepads();
  feed({ type: "tick", wall: Date.now() });
  connection.tick(now);
  if (hold.nonce) sliders.tick(now);
  if (now - drawn > STATUS_PERIOD) invalidate();
}

setInterval(tick, PERIOD);
window.addEventListener("pagehide", () => connection.close());
window.addEventListener("pageshow", (event) => event.persisted && connection.open(takeToken()));
window.addEventListener("hashchange", () => {
  if (location.hash && !document.getElementById(location.hash.slice(1))) connection.open(takeToken());
});
window.addEventListener("online", () => connection.hurry());
document.addEventListener("visibilitychange", () => {
  if (document.visibilityState === "visible") {
    tick();
    connection.hurry();
  }
});
connection.open(takeToken());
