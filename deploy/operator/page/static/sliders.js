/** Sliders for the configuration of the arm, and the way back to the scenario. */

import { announce } from "./announce.js";
import { confirmByHolding } from "./confirm.js";
import { byId, create, setAttributes, setNote, setText } from "./dom.js";
import { UNKNOWN, degrees, sentence } from "./format.js";

const LINK = 5; // m that a slider spans; more when the value is larger
const TURN = 3.15; // rad that a slider spans in both directions; a round number, because its steps begin there
const SLOP = 10; // px that a finger moves before its direction counts
const SPEED = 1; // m/s or rad/s at which the arm follows a slider, with engines on or off
const PERIOD = 100; // ms between two of its steps
const JUMPS = "Hold the button for a second: the arm jumps to the scenario, even with the engines off.";
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
    const follow = () => {
      for (const { name } of this._rows) this._forget(name);
      setNote(byId("set-note"), "");
      if (send({ type: "follow_scenario" })) announce("The arm follows the scenario.");
    };
    confirmByHolding(byId("follow-scenario"), follow, () => setNote(byId("set-note"), JUMPS));
    /** The values to which the arm moves, by name. */
    this._targets = new Map();
    /** How far it has come on the way. */
    this._reached = {};
    this._arm = {};
    this._stepped = -Infinity;
  }

  /** Go a step on to what was set, because a virtual joint would jump. */
  tick(now) {
    if (now - this._stepped < PERIOD) return;
    this._stepped = now;
    const most = (SPEED * PERIOD) / 1000;
    for (const row of this._rows) {
      const { name } = row;
      if (!this._targets.has(name)) continue;
      const target = this._targets.get(name);
      const from = this._reached[name] ?? this._arm[name];
      const isThere = Math.abs(target - from) <= most;
      this._reached[name] = isThere ? target : from + Math.sign(target - from) * most;
      this._send({ type: "set", name, value: this._reached[name] });
      row.touched = now;
      if (isThere) this._forget(name);
    }
  }

  _forget(name) {
    this._targets.delete(name);
    delete this._reached[name];
  }

  refuse(why) {
    setNote(byId("set-note"), `Not set. ${sentence(why)}`);
  }

  render({ arm, unheard, sources, welcome }, isLive, now) {
    this._arm = arm;
    for (const row of this._rows) {
      const { name, slider, field, angle } = row;
      if (!isLive) this._forget(name);
      const source = sources[name];
      setAttributes(row.source, { "data-source": source ?? null });
      setText(row.source, SOURCES[source] ?? "");
      const limits = welcome?.limits?.[name]; // none for a joint of the user's own
      slider.disabled = field.disabled = !isLive || arm[name] === null || !limits;
      if (limits) setAttributes(field, { min: limits[0], max: limits[1] });
      const isHeard = isLive && !unheard.includes(name);
      setAttributes(row.box, { "data-heard": isHeard ? "yes" : "no" });
      if (arm[name] === null || now - row.touched < QUIET) continue;
      this._follow(row, arm[name], isHeard);
      if (angle) setText(angle, degrees(isHeard ? arm[name] : NaN));
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
      placeholder: UNKNOWN,
    });
    const source = create("span", { id: `source-${name}`, class: "source" });
    const angle = isAngle ? create("span", { class: "angle" }) : null;
    const value = create("span", { class: "value" }, field, ` ${unit}`, ...(angle ? [" ", angle] : []));
    const title = create("label", { for: slider.id }, create("b", {}, label), ` ${meaning}`);
    const head = create("div", { class: "head" }, title, source, value);
    const box = create("div", { class: "slider" }, head, slider);
    byId("slider-rows").append(box);

    const row = { name, box, slider, field, source, angle, touched: -Infinity, shown: null };
    const isHeldBack = holdBack(slider, () => this._set(row, slider, field), () => this._show(row, row.newest, true));
    slider.addEventListener("input", () => isHeldBack() || this._set(row, slider, field));
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
    this._targets.set(row.name, value);
    setNote(byId("set-note"), "");
  }

  /** Show the arm's value, unless the user is at this control. */
  _follow(row, value, isHeard) {
    row.newest = value;
    if (Math.abs(value) > Number(row.slider.max)) widen(row.slider, value);
    this._show(row, value, !row.slider.matches(":focus-visible"), isHeard);
  }

  _show(row, value, isSliderFree, isHeard = true) {
    if (value === undefined) return;
    const text = value.toFixed(3);
    const shown = isHeard ? text : "";
    if (isSliderFree && row.slider.value !== text) row.slider.value = text;
    if (row.field !== document.activeElement && row.field.value !== shown) row.field.value = shown;
  }
}

/**
 * Hold back what a finger sets until it moves across: along the page it scrolls, and moves no joint.
 *
 * @param {HTMLInputElement} slider
 * @param {() => void} set called when the finger means the slider's value
 * @param {() => void} restore called when it does not
 * @returns {() => boolean} whether an input is held back
 */
function holdBack(slider, set, restore) {
  let finger = null; // that is down: where it began, which way it goes, and what it would set

  const mean = ({ value }) => {
    if (value === null) return;
    slider.value = value;
    set();
  };
  slider.addEventListener("pointerdown", ({ pointerType, clientX, clientY }) => {
    finger = pointerType === "mouse" ? null : { clientX, clientY, way: null, value: null };
  });
  slider.addEventListener("pointermove", ({ clientX, clientY }) => {
    if (!finger || finger.way) return;
    const across = Math.abs(clientX - finger.clientX);
    const along = Math.abs(clientY - finger.clientY);
    if (Math.max(across, along) < SLOP) return;
    finger.way = across > along ? "across" : "along";
    if (finger.way === "across") mean(finger);
  });
  for (const type of ["pointerup", "pointercancel"]) {
    slider.addEventListener(type, () => {
      const lifted = finger;
      finger = null;
      if (!lifted || lifted.way === "across") return;
      if (type === "pointerup" && !lifted.way) mean(lifted); // a tap
      else restore();
    });
  }
  return () => {
    if (!finger || finger.way === "across") return false;
    finger.value = slider.value;
    return true;
  };
}

/** Let a slider reach a value that lies beyond its range. */
function widen(slider, value) {
  const most = Math.ceil(Math.abs(value) * 1.25);
  setAttributes(slider, { max: most, ...(Number(slider.min) < 0 ? { min: -most } : {}) });
}
