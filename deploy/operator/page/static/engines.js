/** The engines: on or off, why, and the buttons. */

import { alert, announce, onChange } from "./announce.js";
import { byId, onActivate, setAttributes, setNote, setText } from "./dom.js";
import { sentence, wholeSeconds } from "./format.js";

const STATES = {
  on: ["good", "Engines on"],
  off: ["idle", "Engines off"],
};
const NO_STATE = ["warn", "Engines: no word from the controller"];
const UNKNOWN = ["idle", "Engines: unknown"];
const LATCH = 2; // s after a click on "Turn on" in which a hand may begin to hold
const ADVICE = `Hold and press Enter; or click “Turn on”, and hold within ${LATCH} s.`;
const LATCHED = `Now hold the button within ${LATCH} s.`;

export class Engines {
  /** @param {(message: object) => boolean} send */
  constructor(send) {
    this._send = send;
    /** Until when a hold turns the engines on [ms]: a mouse alone cannot click while it holds. */
    this._latched = -Infinity;
    onActivate(byId("turn-on"), () => {
      this._refused = "";
      if (this._isHeld) this.command("turn_on");
      else this._latched = performance.now() + 1000 * LATCH;
    });
    onActivate(byId("turn-off"), () => this.command("turn_off"));
    /** Why this page's last command was refused by the server. */
    this._refused = "";
    this._changed = onChange((state, before) => {
      if (state) (before === null || state === "on" ? announce : alert)(`${STATES[state][1]}. ${this._why}`);
    });
    this._refusedChanged = onChange((why) => why && alert(why));
  }

  refuse(why) {
    this._refused = why;
  }

  command(command) {
    this._refused = "";
    this._latched = -Infinity;
    this._send({ type: "engines", command });
  }

  /** Turn the engines on if "Turn on" was clicked, and then a hand began to hold. */
  _unlatch({ switch: hold, operator }, isOurs) {
    this._isHeld = hold.held;
    if (this._latched === -Infinity) return;
    if (isOurs) {
      this._latched = Infinity; // in time
      if (hold.by === "this_page" && operator.seen) this.command("turn_on");
    } else if (performance.now() > this._latched || this._latched === Infinity) {
      this._latched = -Infinity;
      this.refuse("nobody holds");
    }
  }

  render(model, isLive, isOurs) {
    const { engines, time } = model;
    this._unlatch(model, isOurs);
    const [sign, text] = STATES[engines.state] ?? (isLive ? NO_STATE : UNKNOWN);
    this._why = sentence(engines.why ?? "");
    setAttributes(byId("engines"), { "data-state": engines.state ?? "unknown" });
    for (const id of ["engines-sign", "mini-engines-sign"]) setAttributes(byId(id), { "data-sign": sign });
    setText(byId("engines-text"), text);
    setText(byId("mini-engines"), engines.state ? text : "Engines: unknown");
    const ago = !Number.isFinite(time - (engines.since ?? NaN)) ? "" : `, ${wholeSeconds(time - engines.since)} ago`;
    setText(byId("engines-why"), sentence((engines.why ?? "") + ago));
    setAttributes(byId("turn-on"), { "data-suggested": engines.state === "off" ? "yes" : null });
    setAttributes(byId("turn-off"), { "data-stops": engines.state === "off" ? null : "yes" });
    for (const id of ["turn-on", "turn-off"]) setAttributes(byId(id), { "aria-disabled": isLive ? null : true });
    const refused = this._refused || engines.refused;
    const why = refused?.replace(/^turn_on refused: /, "");
    const isOn = engines.state === "on";
    const note = isOn ? "" : this._latched > 0 ? LATCHED : why ? `Not turned on: ${why}. ${ADVICE}` : "";
    setNote(byId("engines-refused"), note);
    if (engines.why || !isLive) this._changed(engines.state); // the cause comes a little later
    this._refusedChanged(note);
  }
}
