/** Whether the operator is seen, how long not, and how many strikes are left. */

import { alert, announce, onChange } from "./announce.js";
import { byId, create, draw, setAttributes, setText } from "./dom.js";
import { duration } from "./format.js";
import { operatorState } from "./model.js";

const MOST_PIPS = 10;

const OPERATORS = {
  seen: ["good", "Operator seen"],
  unseen: ["idle", "Operator not seen"],
  missed: ["warn", "Operator missed"],
  incapacitated: ["bad", "Operator incapacitated"],
};

export class Operator {
  constructor() {
    this._welcome = null;
    this._changed = onChange((state, before) => {
      const [, text] = OPERATORS[state] ?? [];
      if (text) (before === null || state === "seen" ? announce : alert)(`${text}.`);
    });
    this._strikesChanged = onChange((left, before) => {
      if (left !== null && left < before) alert(`${strikesText(left)}.`);
    });
  }

  render({ operator, welcome, switch: hold }) {
    if (welcome && welcome !== this._welcome) this._begin(welcome);
    const state = operatorState(operator);
    const [sign, text] = OPERATORS[state] ?? ["idle", "Operator: unknown"];
    setAttributes(byId("operator"), { "data-state": state ?? "unknown" });
    for (const id of ["operator-sign", "mini-operator-sign"]) setAttributes(byId(id), { "data-sign": sign });
    const age = operator.age !== null && !operator.seen ? `, last seen ${duration(operator.age)} ago` : "";
    setText(byId("operator-text"), text + age);
    setText(byId("mini-operator"), state === "seen" && hold.by === "this_page" ? "You hold" : text);
    this._drawSilence(operator.age);
    this._drawStrikes(operator.strikes_left);
    this._changed(state);
    this._strikesChanged(operator.strikes_left);
  }

  /** Draw the scale of the silence: a mark at each strike, the end where the engines stop. */
  _begin(welcome) {
    this._welcome = welcome;
    const { silence, presence_timeout: limit } = welcome;
    const labels = byId("silence-labels");
    labels.replaceChildren();
    let ticks = "";
    for (let at = silence; at < limit; at += silence) ticks += `M${((at / limit) * 100).toFixed(2)} 0V6`;
    setAttributes(byId("silence-ticks"), { d: ticks });
    for (const text of ["0 s", "unseen", `${limit} s`]) labels.append(create("span", {}, text));
    byId("strike-pips").replaceChildren();
  }

  _drawSilence(age) {
    const limit = this._welcome?.presence_timeout ?? 10;
    setAttributes(byId("silence-fill"), { width: (Math.min(1, (age ?? 0) / limit) * 100).toFixed(1) });
  }

  _drawStrikes(left) {
    const all = this._welcome?.strikes ?? 3;
    const pips = byId("strike-pips");
    setAttributes(byId("strikes"), { "data-left": left });
    setText(byId("strikes-text"), left === null ? "" : strikesText(left, all));
    setText(byId("mini-strikes"), left === null ? "" : strikesText(left));
    if (pips.childElementCount !== all && all <= MOST_PIPS) {
      pips.replaceChildren();
      for (let index = 0; index < all; index += 1) {
        const svg = draw(pips, "svg", { viewBox: "0 0 16 16" });
        draw(svg, "circle", { cx: 8, cy: 8, r: 6.5 });
        draw(svg, "path", { d: "M5 5 11 11M11 5 5 11" });
      }
    }
    [...pips.children].forEach((pip, index) => {
      setAttributes(pip, { "data-used": left === null ? "unknown" : index >= left ? "yes" : "no" });
    });
  }
}

function strikesText(left, all = null) {
  return `${left}${all === null ? "" : ` of ${all}`} ${(all ?? left) === 1 ? "strike" : "strikes"} left`;
}
