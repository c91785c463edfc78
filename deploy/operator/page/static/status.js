/** The connection: how it is, since when it is lost; the greyed page; title and clock. */

import { alert, announce, onChange } from "./announce.js";
import { byId, onActivate, setAttributes, setText } from "./dom.js";
import { clock, sentence, timeOfDay } from "./format.js";
import { GAP } from "./hold.js";

const WORDS = {
  connecting: ["idle", "Connecting"],
  refused: ["bad", "Not connected"],
  live: ["good", "Live"],
  lost: ["bad", "Connection lost"],
  closed: ["bad", "Not connected"],
};

const LAST_BEAT = GAP / 1000; // s after the last word of the server, in which this page may have sent a beat
const PATIENCE = 2; // failures of the first connection until the page reports them

export class Status {
  constructor() {
    onActivate(byId("health"), () => {
      const row = document.querySelector("#processes tr[data-ok=no]") ?? byId("services");
      row.scrollIntoView({ block: "center" });
    });
    this._changed = onChange((state, before) => {
      if (state === "live") announce(before === "lost" ? "Connected again. The button is released." : "Connected.");
      if (state === "lost") alert("Connection lost. The button is released.");
    });
  }

  render(connection, model) {
    const { state, since, why } = connection;
    const isLost = state === "lost" || state === "closed" || connection.failures >= PATIENCE || connection.refused;
    const [sign, text] = WORDS[isLost && state === "connecting" ? "refused" : state];
    setAttributes(document.documentElement, { "data-connection": state });
    setAttributes(byId("connection-sign"), { "data-sign": sign });
    setText(byId("connection-text"), text);
    setText(byId("clock"), clock(model.time));
    this._tellHealth(state === "live" ? model.processes : []);
    byId("banner").hidden = state === "live";
    if (isLost) {
      const refusal = connection.refused && sentence(connection.refused);
      const silence = state === "lost" ? `Connection lost since ${timeOfDay(since)}.` : "No answer. Does make run still run?";
      setText(byId("banner-text"), why || refusal || silence);
      setText(byId("banner-age"), `${withoutUs(model, since, Date.now())}${why ? "" : " Trying again …"}`);
    }
    const engines = model.engines.state;
    const now = isLost ? text : engines ? `Engines ${engines}` : "";
    const title = now ? `${now} · reactive-arm` : "reactive-arm";
    if (document.title !== title) document.title = title;
    if (why) alertOnce(why);
    this._changed(state);
  }

  _tellHealth(processes) {
    const well = processes.filter(({ ok, state }) => ok && state === "RUNNING").length;
    byId("health").hidden = !processes.length;
    setAttributes(byId("health-sign"), { "data-sign": well === processes.length ? "good" : "bad" });
    setText(byId("health-text"), `${well} of ${processes.length} ok`);
  }
}

/**
 * What the robot does by itself, as far as a page without a connection knows.
 *
 * @param {object} model what the page knew
 * @param {Date} since when it heard that
 * @param {number} now wall clock time [ms]
 */
export function withoutUs({ engines, switch: hold, operator, welcome }, since, now) {
  const isOurs = hold.by === "this_page";
  if (engines.state === "on" && (isOurs || !hold.held)) {
    const lastSign = isOurs ? LAST_BEAT : -(operator.age ?? 0); // s after the last word
    const end = Math.ceil(since / 1000 + lastSign + welcome.off_within) * 1000;
    if (now < end) return `The engines stop by ${timeOfDay(new Date(end))} at the latest, unless another hand holds.`;
  }
  return engines.state === "off" ? "The engines were off. What they do now is unknown." : "What the engines do is unknown.";
}

const alertOnce = (() => {
  let shown = "";
  return (why) => {
    if (why !== shown) alert(why);
    shown = why;
  };
})();
