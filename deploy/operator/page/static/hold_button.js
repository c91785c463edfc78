/** The hold-to-run button as it looks, and what changes of it are said. */

import { alert, announce, onChange } from "./announce.js";
import { byId, setAttributes, setText } from "./dom.js";
import { sentence } from "./format.js";

const SHORT = 400; // ms; a shorter press is taken for a click

/** Title and hint of the button by its state; `stop`: time until the engines are off [s]. */
const WORDS = {
  offline: () => ["Not connected", "Released. Holding needs a connection."],
  released: () => ["Hold to run", "Released. Press and hold here."],
  pressing: () => ["Pressed", "Waiting for the switch …"],
  held: (stop) => ["Held by you", `Let go, and the engines stop within ${stop} s.`],
  releasing: () => ["Let go", "Waiting for the switch …"],
  other_page: () => ["Held on another page", "Only one page can hold at a time."],
  terminal: () => ["Hold to run", "The terminal holds. Hold here to take over."],
  scenario: () => ["Hold to run", "The scenario holds. Hold here to take over."],
};

/**
 * What the button shows.
 *
 * @returns {keyof WORDS}
 */
export function holdState(isLive, hold, shown) {
  if (!isLive) return "offline";
  const isOurs = shown.held && shown.by === "this_page";
  if (hold.held) return isOurs ? "held" : "pressing";
  if (isOurs) return "releasing";
  return shown.held ? (shown.by ?? "terminal") : "released";
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
    const [title, hint] = WORDS[state](model.welcome?.off_within);
    setAttributes(this._button, {
      "data-state": state,
      "aria-pressed": hold.held,
      "aria-disabled": isLive ? null : true,
    });
    setText(byId("hold-title"), title);
    setText(byId("hold-hint"), hint);
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
    if (state === "held" || state === "other_page") announce(`${WORDS[state](0)[0]}.`);
    if (isOurs || !wasOurs) return;
    if (this._why) {
      alert(sentence(this._why));
      navigator.vibrate?.([60, 40, 60]);
    } else {
      const isShort = now - this._pressedAt < SHORT;
      this._hint = isShort ? "Keep holding: the engines run only while you hold." : "";
      announce(isShort ? this._hint : "Released.");
    }
  }
}
