/** The engines: on or off, why, and the buttons. */

import { alert, announce, onChange } from "./announce.js";
import { byId, onActivate, setAttributes, setNote, setText } from "./dom.js";
import { sentence, wholeSeconds } from "./format.js";

const STATES = {
  on: ["good", "Engines on"],
  off: ["idle", "Engines off"],
};
const NO_STATE = ["warn", "Engines: no word from the controller"];
const ADVICE = "Hold first, then turn on while you hold: with a second finger, or hold Space and click.";

export class Engines {
  /** @param {(message: object) => boolean} send */
  constructor(send) {
    for (const command of ["turn_on", "turn_off"]) {
      onActivate(byId(command.replace("_", "-")), () => {
        this._refused = "";
        send({ type: "engines", command });
      });
    }
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

  render({ engines, time }, isLive) {
    const [sign, text] = STATES[engines.state] ?? NO_STATE;
    this._why = sentence(engines.why ?? "");
    setAttributes(byId("engines"), { "data-state": engines.state ?? "unknown" });
    for (const id of ["engines-sign", "mini-engines-sign"]) setAttributes(byId(id), { "data-sign": sign });
    setText(byId("engines-text"), text);
    setText(byId("mini-engines"), engines.state ? text : "Engines: unknown");
    const ago = engines.since === null ? "" : `, ${wholeSeconds(time - engines.since)} ago`;
    setText(byId("engines-why"), sentence((engines.why ?? "") + ago));
    setAttributes(byId("turn-on"), { "data-suggested": engines.state === "off" ? "yes" : null });
    for (const id of ["turn-on", "turn-off"]) setAttributes(byId(id), { "aria-disabled": isLive ? null : true });
    const refused = this._refused || engines.refused;
    const why = refused?.replace(/^turn_on refused: /, "");
    const note = why && engines.state !== "on" ? `Not turned on: ${why}. ${ADVICE}` : "";
    setNote(byId("engines-refused"), note);
    this._changed(engines.state);
    this._refusedChanged(note);
  }
}
