/** The connection: how it is, since when it is lost; the greyed page; title and clock. */

import { alert, announce, onChange } from "./announce.js";
import { byId, setAttributes, setText } from "./dom.js";
import { clock, duration, timeOfDay } from "./format.js";

const WORDS = {
  connecting: ["idle", "Connecting"],
  live: ["good", "Live"],
  lost: ["bad", "Connection lost"],
  closed: ["bad", "Not connected"],
};

const PATIENCE = 2; // failures of the first connection until the page tells of them

export class Status {
  constructor() {
    this._changed = onChange((state, before) => {
      if (state === "live") announce(before === "lost" ? "Connected again. The button is released." : "Connected.");
      if (state === "lost") alert("Connection lost. The button is released.");
    });
  }

  render(connection, model) {
    const { state, since, why } = connection;
    const [sign, text] = WORDS[state];
    setAttributes(document.documentElement, { "data-connection": state });
    setAttributes(byId("connection-sign"), { "data-sign": sign });
    setText(byId("connection-text"), text);
    setText(byId("clock"), clock(model.time));
    const isLost = state === "lost" || state === "closed" || connection.failures >= PATIENCE;
    byId("banner").hidden = !isLost;
    if (isLost) {
      const age = (Date.now() - since) / 1000;
      const wasLive = state === "lost";
      const lost = wasLive ? `Connection lost since ${timeOfDay(since)}.` : "No answer. Does make run still run?";
      const shown = wasLive ? `The page shows the state of ${duration(Math.floor(age))} ago. ` : "";
      setText(byId("banner-text"), why || lost);
      setText(byId("banner-age"), why ? "" : `${shown}Trying again …`);
    }
    const engines = model.engines.state;
    const now = isLost ? text : engines ? `Engines ${engines}` : "";
    const title = now ? `${now} · reactive-arm` : "reactive-arm";
    if (document.title !== title) document.title = title;
    if (why) alertOnce(why);
    this._changed(state);
  }
}

const alertOnce = (() => {
  let told = "";
  return (why) => {
    if (why !== told) alert(why);
    told = why;
  };
})();
