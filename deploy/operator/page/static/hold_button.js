/** The hold-to-run button as it looks, and what changes of it are said. */

import { alert, announce, onChange } from "./announce.js";
import { byId, setAttributes, setText } from "./dom.js";
import { sentence } from "./format.js";

const SHORT = 400; // ms; a shorter press is taken for a click

const OTHERS = {
  other_page: "Another page holds. Only one can.",
  terminal: "The terminal holds. Hold here to take over.",
  dead_mans_switch: "The scenario holds. Hold here to take over.",
};

/**
 * Title and hint of the button: what the engines do, and what happens without the hand.
 *
 * @param {string} state of {@link holdState}
 * @param {{state: string|null, stops_in: number|null}} engines
 * @param {number} bound time after which they are off, whatever dies [s]
 */
export function words(state, engines, bound) {
  const isOn = engines.state === "on";
  const left = engines.stops_in === null ? "soon" : `in ${Math.ceil(engines.stops_in)} s`;
  switch (state) {
    case "offline":
      return ["Not connected", "Released. Holding needs a connection."];
    case "pressing":
      return ["Pressed", "Waiting for the switch …"];
    case "releasing":
      return ["Let go", "Waiting for the switch …"];
    case "held":
      if (isOn) return ["ENGINES ON", `Let go: off ${left}, or ${bound}\u00a0s if programs crash.`];
      return engines.state === "off"
        ? ["Held, now turn on", "Press Enter, or use a second finger."]
        : ["Held", "No word from the engine controller."];
    case "released":
      if (!isOn) return ["Hold", `Engines ${engines.state ?? "unknown"}. Press and hold here.`];
      return engines.stops_in === 0
        ? ["Stops now", "Released. Hold and turn on again."]
        : [`Stops ${left}, hold to keep`, "Released, engines on."];
    default:
      return [isOn ? "ENGINES ON" : state === "other_page" ? "Held on another page" : "Hold", OTHERS[state] ?? `Held by ${state}. Hold here to take over.`];
  }
}

/** How much of the fuse is left, from 0 to 1. */
export function fuse({ engines, welcome }) {
  if (engines.state !== "on" || engines.stops_in === null) return 0;
  return Math.min(1, engines.stops_in / Math.min(welcome.strikes * welcome.silence, welcome.presence_timeout));
}

/**
 * What the button shows.
 *
 * @returns {string} the state of the button
 */
export function holdState(isLive, hold, shown) {
  if (!isLive) return "offline";
  const isOurs = shown.held && shown.by === "this_page";
  if (hold.held) return isOurs ? "held" : "pressing";
  if (isOurs) return "releasing";
  return shown.held ? (shown.by ?? "somebody") : "released";
}

export class HoldButton {
  constructor() {
    this._button = byId("hold");
    this._pressedAt = 0;
    this._hint = "";
    this._changed = onChange((state, before) => this._tell(state, before));
  }

  render(model, hold, isLive) {
    const state = holdState(isLive, hold, model.switch);
    const [title, hint] = words(state, model.engines, model.welcome?.off_within);
    this._title = title;
    setAttributes(this._button, {
      "data-state": state,
      "data-engines": isLive ? (model.engines.state ?? "unknown") : "unknown",
      "aria-pressed": hold.held,
      "aria-disabled": isLive ? null : true,
    });
    setText(byId("hold-title"), title);
    setText(byId("hold-hint"), hint);
    setAttributes(byId("fuse"), { "stroke-dasharray": `${isLive ? Math.round(100 * fuse(model)) : 0} 100` });
    this._why = hold.why;
    this._changed(state);
    setText(byId("hold-why"), sentence(hold.why) || this._hint);
  }

  _tell(state, before) {
    const now = performance.now();
    const wasOurs = before === "pressing" || before === "held";
    const isOurs = state === "pressing" || state === "held";
    if (isOurs && !wasOurs) {
      this._pressedAt = now;
      this._hint = "";
    }
    if (state === "held" || state === "other_page") announce(`${this._title}.`);
    if (isOurs || !wasOurs) return;
    if (this._why) {
      alert(sentence(this._why));
      navigator.vibrate?.([60, 40, 60]);
    } else {
      const isShort = now - this._pressedAt < SHORT;
      this._hint = isShort ? "Keep holding: the engines run only while you hold." : "";
      announce(isShort ? this._hint : state === "released" ? `Released. ${this._title}.` : "Released.");
    }
  }
}
