/** Sliders for the configuration of the arm, and the way back to the scenario. */

import { announce } from "./announce.js";
import { byId, create, onActivate, setAttributes, setNote, setText } from "./dom.js";
import { degrees, sentence } from "./format.js";

const LINK = 5; // m that a slider spans; more when the value is larger
const TURN = 3.15; // rad that a slider spans in both directions; a round number, because its steps begin there
const QUIET = 400; // ms after an input until the slider follows the arm again

const ROWS = [
  { name: "l1", label: "l₁", meaning: "first link", unit: "m" },
  { name: "l2", label: "l₂", meaning: "second link", unit: "m" },
  { name: "theta1", label: "θ₁", meaning: "first joint", unit: "rad" },
  { name: "theta2", label: "θ₂", meaning: "second joint", unit: "rad" },
];
const SOURCES = { scenario: "scenario", hand: "by hand" };

export class Sliders {
  /** @param {(message: object) => boolean} send */
  constructor(send) {
    this._send = send;
    this._rows = ROWS.map((row) => this._build(row));
    onActivate(byId("follow-scenario"), () => {
      this._pending.clear();
      setNote(byId("set-note"), "");
      if (send({ type: "follow_scenario" })) announce("The arm follows the scenario.");
    });
    /** Values that wait for the next tick: the newest of each name. */
    this._pending = new Map();
  }

  /** Send what was set since the last call. */
  tick() {
    for (const [name, value] of this._pending) this._send({ type: "set", name, value });
    this._pending.clear();
  }

  refuse(why) {
    setNote(byId("set-note"), `Not set. ${sentence(why)}`);
  }

  render({ arm, sources, welcome }, isLive, now) {
    for (const row of this._rows) {
      const { name, slider, field, angle } = row;
      const source = sources[name];
      setAttributes(row.source, { "data-source": source ?? null });
      setText(row.source, SOURCES[source] ?? "");
      const limits = welcome?.limits?.[name]; // none for a joint of the user's own
      slider.disabled = field.disabled = !isLive || arm[name] === null || !limits;
      if (limits) setAttributes(field, { min: limits[0], max: limits[1] });
      if (arm[name] === null || now - row.touched < QUIET) continue;
      this._follow(row, arm[name]);
      if (angle) setText(angle, degrees(arm[name]));
    }
    const isByHand = Object.values(sources).includes("hand");
    setAttributes(byId("follow-scenario"), { "aria-disabled": isLive && isByHand ? null : true });
  }

  _build({ name, label, meaning, unit }) {
    const isAngle = unit === "rad";
    const words = `${label}, ${meaning}`;
    const slider = create("input", {
      type: "range", id: `set-${name}`, "aria-label": `${words}, ${unit}`,
      min: isAngle ? -TURN : 0, max: isAngle ? TURN : LINK, step: "0.01", disabled: "",
    });
    const field = create("input", {
      type: "number", id: `number-${name}`, "aria-label": `${words}, exact value in ${unit}`, step: "any", disabled: "",
    });
    const source = create("span", { id: `source-${name}`, class: "source" });
    const angle = isAngle ? create("span", { class: "angle" }) : null;
    const value = create("span", { class: "value" }, field, ` ${unit}`, ...(angle ? [" ", angle] : []));
    const title = create("label", { for: slider.id }, create("b", {}, label), ` ${meaning}`);
    const head = create("div", { class: "head" }, title, source, value);
    byId("slider-rows").append(create("div", { class: "slider" }, head, slider));

    const row = { name, slider, field, source, angle, touched: -Infinity, shown: null };
    slider.addEventListener("input", () => this._set(row, slider, field));
    // A focused slider stands still for the ears; the first key begins at the arm's true value.
    slider.addEventListener("keydown", () => this._show(row, row.newest, true));
    field.addEventListener("change", () => field.reportValidity() && this._set(row, field, slider));
    return row;
  }

  _set(row, from, to) {
    if (from.value === "") return;
    const value = Number(from.value);
    row.touched = performance.now();
    to.value = from.value;
    if (row.angle) setText(row.angle, degrees(value));
    this._pending.set(row.name, value);
    setNote(byId("set-note"), "");
  }

  /** Show the arm's value, unless the user is at this control. */
  _follow(row, value) {
    row.newest = value;
    if (Math.abs(value) > Number(row.slider.max)) widen(row.slider, value);
    this._show(row, value, !row.slider.matches(":focus-visible"));
  }

  _show(row, value, isSliderFree) {
    if (value === undefined) return;
    const text = value.toFixed(3);
    if (isSliderFree && row.slider.value !== text) row.slider.value = text;
    if (row.field !== document.activeElement && row.field.value !== text) row.field.value = text;
  }
}

/** Let a slider reach a value that lies beyond its range. */
function widen(slider, value) {
  const most = Math.ceil(Math.abs(value) * 1.25);
  setAttributes(slider, { max: most, ...(Number(slider.min) < 0 ? { min: -most } : {}) });
}
