/** The arm to scale, with its joint angles, reach and the effector's recent path. */

import { byId, draw, setAttributes, setText } from "./dom.js";
import { degrees, digitsOf, number } from "./format.js";
import { niceStep } from "./scale.js";

const EDGE = 108; // of the drawing, in its units, from the base
const EXTENT = 330; // of the grid: a wide window shows more than the square
const PATH_TIME = 8; // s
const CALM = 0.2; // s between two numbers that are read, or two whole paths: texts and long paths cost most
const PATH_PARTS = 5; // of falling opacity
const JOINTS = ["l1", "l2", "theta1", "theta2"];
const SUMMARY_PERIOD = 1; // s
const LEAST_ARC = 0.05; // rad; a shorter arc cannot be seen, and has no label
const LABEL = { width: 48, height: 14 }; // of an angle
const STOPPING = 0.5; // s after "off" in which news of a movement may still come
const MOVED = 1; // s for which the drawing reports a movement without engines
const POWERS = {
  on: "Engines on",
  off: "Engines off: stands still",
  moved: "Moved with the engines off",
  unknown: "Engines unknown",
};
const TOLERANCE = 0.03; // of the reach, between the reported position and the joints'

export class Arm {
  constructor() {
    this._svg = byId("arm");
    this._view = 0; // radius that is shown [m]
    this._summarized = -Infinity;
    this.forget();
    this._build();
  }

  /** Forget what was drawn: what comes next is of another time. */
  forget() {
    this._drawn = {};
    this._moved = -Infinity;
    this._told = -Infinity;
  }

  /** Draw the newest state. */
  render(model, isLive) {
    const { arm, position, trace, time, unheard, engines, speed } = model;
    const drawn = this._drawn;
    const isOff = engines.state === "off" && !(time - engines.since < STOPPING);
    const hasMoved = JOINTS.some((name) => (drawn.arm?.[name] ?? arm[name]) !== arm[name]);
    if (isOff && hasMoved) this._moved = time;
    const isKnownAsBefore = unheard === drawn.unheard && isLive === drawn.isLive;
    this._tells = !isKnownAsBefore || Math.abs(time - this._told) >= CALM;
    if (this._tells) this._told = time;
    if (this._tells || arm !== drawn.arm || position !== drawn.position) {
      this._drawn = { arm, position, unheard, isLive };
      const isHeard = (name) => isLive && !unheard.includes(name);
      const isKnown = Object.values(arm).every((value) => value !== null);
      this._moving.setAttribute("visibility", isKnown ? "visible" : "hidden");
      if (isKnown) this._place(arm, position, isHeard);
      this._digits = isKnown ? digitsOf(arm.l1 + arm.l2) : 2;
      const shown = isHeard("position") ? position : null;
      if (this._tells) {
        setText(byId("x"), number(shown?.x, this._digits));
        setText(byId("y"), number(shown?.y, this._digits));
        setText(byId("speed"), number(isLive ? speed : null));
        this._summarize(arm, shown, isKnown && JOINTS.every(isHeard), time);
      }
    }
    if (this._tells) this._drawPath(trace, time);
    this._drawHead(trace);
    const power = isLive ? (engines.state ?? "unknown") : "unknown";
    setAttributes(this._svg, { "data-power": power === "off" && time - this._moved < MOVED ? "moved" : power });
    setText(this._power, POWERS[this._svg.dataset.power]);
  }

  _build() {
    const svg = this._svg;
    this._grid = draw(svg, "path", { class: "grid" });
    this._ring = draw(svg, "path", { class: "reach-area", "fill-rule": "evenodd" });
    this._axes = draw(svg, "path", { class: "axes", d: `M${-EXTENT} 0H${EXTENT}M0 ${-EXTENT}V${EXTENT}` });
    this._ticks = draw(svg, "g", { class: "ticks" });
    this._reach = draw(svg, "circle", { class: "reach" });
    this._reachLabel = draw(svg, "text", { class: "reach-label", "text-anchor": "middle" });
    this._power = draw(svg, "text", { class: "power", x: -116, y: 104 });
    this._paths = Array.from({ length: PATH_PARTS }, (_, part) =>
      draw(svg, "path", { class: "trail", "stroke-opacity": ((part + 1) / PATH_PARTS).toFixed(2) }),
    );
    this._head = draw(svg, "path", { class: "trail" });
    this._moving = draw(svg, "g", { visibility: "hidden" });
    const moving = this._moving;
    this._extension = draw(moving, "line", { class: "extension" });
    this._angles = ["one", "two"].map((name) => ({
      arc: draw(moving, "path", { class: `angle ${name}` }),
      label: null,
    }));
    draw(moving, "path", { class: "base", d: "M-13 11H13M-9 11 -5 0H5L9 11Z" });
    this._links = ["one", "two"].map((name) => ({
      outer: draw(moving, "line", { class: `link ${name}` }),
      inner: draw(moving, "line", { class: "link-core" }),
    }));
    draw(moving, "circle", { class: "joint", r: 5 });
    this._elbow = draw(moving, "circle", { class: "joint", r: 4.5 });
    this._lag = draw(moving, "line", { class: "lag" });
    this._effector = draw(moving, "g", { class: "effector" });
    draw(this._effector, "circle", { class: "halo", r: 7.5 });
    draw(this._effector, "circle", { class: "dot", r: 3.5 });
    this._lagLabel = draw(this._effector, "text", { class: "lag", y: 2.5 });
    setText(this._lagLabel, "last position");
    for (const angle of this._angles) {
      angle.label = draw(moving, "text", { class: "angle-label", "text-anchor": "middle" });
    }
  }

  _place(arm, position, isHeard) {
    const reach = arm.l1 + arm.l2;
    this._fit(reach);
    const scale = EDGE / this._view;
    const one = arm.theta1;
    const two = arm.theta1 + arm.theta2;
    const elbow = [arm.l1 * Math.cos(one) * scale, -arm.l1 * Math.sin(one) * scale];
    const tip = [elbow[0] + arm.l2 * Math.cos(two) * scale, elbow[1] - arm.l2 * Math.sin(two) * scale];
    const seen = position ? [position.x * scale, -position.y * scale] : tip;

    setAttributes(this._reach, { r: (reach * scale).toFixed(2) });
    setAttributes(this._reachLabel, { x: 0, y: (-reach * scale - 3).toFixed(2) });
    setText(this._reachLabel, `reach ${number(reach, digitsOf(reach))} m`);
    setAttributes(this._ring, { d: circle(reach * scale) + circle(Math.abs(arm.l1 - arm.l2) * scale) });

    line(this._links[0], [0, 0], elbow);
    line(this._links[1], elbow, tip);
    setAttributes(this._elbow, { cx: elbow[0].toFixed(2), cy: elbow[1].toFixed(2) });
    const beyond = 30;
    ends(this._extension, elbow, [elbow[0] + beyond * Math.cos(one), elbow[1] - beyond * Math.sin(one)]);
    arc(this._angles[0].arc, [0, 0], 0, one, 20);
    arc(this._angles[1].arc, elbow, one, arm.theta2, 16);
    const [placeOne, placeTwo] = labelPlaces(one, arm.theta2, elbow);
    this._label(0, placeOne, isHeard("theta1") ? arm.theta1 : NaN, "θ₁");
    this._label(1, placeTwo, isHeard("theta2") ? arm.theta2 : NaN, "θ₂");
    setAttributes(this._moving, { "data-heard": JOINTS.every(isHeard) ? "yes" : "no" });

    const isCurrent = !position || Math.hypot(seen[0] - tip[0], seen[1] - tip[1]) <= TOLERANCE * reach * scale;
    setAttributes(this._svg, { "data-current": isCurrent ? "yes" : "no" });
    setAttributes(this._effector, { transform: `translate(${seen[0].toFixed(2)} ${seen[1].toFixed(2)})` });
    setAttributes(this._lagLabel, { x: seen[0] > 0 ? -11 : 11, "text-anchor": seen[0] > 0 ? "end" : "start" });
    ends(this._lag, tip, seen);
  }

  _label(index, [x, y], angle, name) {
    const { label } = this._angles[index];
    setAttributes(label, { transform: `translate(${x.toFixed(1)} ${(y + 2.8).toFixed(1)})` }); // lays out no text
    if (this._tells) setText(label, Math.abs(wrap(angle)) < LEAST_ARC ? "" : `${name} ${degrees(angle)}`);
  }

  /** Choose the radius that is shown; it changes seldom, so that links visibly grow and shrink. */
  _fit(reach) {
    if (reach <= this._view && reach >= this._view * 0.4 && this._view > 0) return;
    this._view = reach > 0 ? reach * (this._view ? 1.15 : 1) : 1;
    const scale = EDGE / this._view;
    const stride = niceStep(this._view / 2.5);
    const digits = Math.max(0, -Math.floor(Math.log10(stride)));
    const half = stride / 2;
    const count = Math.min(80, Math.floor(EXTENT / (half * scale)));
    let grid = "";
    this._ticks.replaceChildren();
    for (let index = -count; index <= count; index += 1) {
      const at = (index * half * scale).toFixed(2);
      grid += `M${at} ${-EXTENT}V${EXTENT}M${-EXTENT} ${at}H${EXTENT}`;
      if (index % 2 || Math.abs(index * half) > this._view) continue;
      const isLast = (index + 2) * half > this._view;
      const text = `${number(index * half, digits)}${isLast ? " m" : ""}`;
      draw(this._ticks, "text", { x: at, y: 117.5, "text-anchor": "middle" }).textContent = text;
      if (index) draw(this._ticks, "text", { x: -118, y: (2.2 - at).toFixed(2) }).textContent = text;
    }
    setAttributes(this._grid, { d: grid });
  }

  _drawPath(trace, time) {
    const from = trace.from(time - PATH_TIME);
    const scale = EDGE / this._view;
    const parts = Array(PATH_PARTS).fill("");
    let last = "";
    let lastPart = -1;
    for (let row = from; row < trace.length; row += 1) {
      const age = Math.min(PATH_TIME - 1e-6, Math.max(0, time - trace.at(row, 0)));
      const part = PATH_PARTS - 1 - Math.floor((age / PATH_TIME) * PATH_PARTS);
      const x = trace.at(row, 1) * scale;
      const y = -trace.at(row, 2) * scale;
      if (!Number.isFinite(x + y)) continue;
      const point = `${x.toFixed(1)} ${y.toFixed(1)}`;
      if (point === last) continue; // the arm stands
      if (part === lastPart) parts[part] += `L${point}`;
      else parts[part] += last ? `M${last}L${point}` : `M${point}`;
      lastPart = part;
      last = point;
    }
    parts.forEach((d, part) => setAttributes(this._paths[part], { d }));
    this._end = last ? trace.at(trace.length - 1, 0) : Infinity;
  }

  /** Draw the path since its whole was drawn. */
  _drawHead(trace) {
    const scale = EDGE / this._view;
    let d = "";
    for (let row = trace.from(this._end); row < trace.length; row += 1) {
      const point = `${(trace.at(row, 1) * scale).toFixed(1)} ${(-trace.at(row, 2) * scale).toFixed(1)}`;
      if (!point.includes("NaN")) d += `${d ? "L" : "M"}${point}`;
    }
    setAttributes(this._head, { d });
  }

  /** Describe to a screen reader, on its demand, what the drawing shows. */
  _summarize(arm, position, isKnown, time) {
    if (Math.abs(time - this._summarized) < SUMMARY_PERIOD && isKnown === this._wasKnown) return;
    this._summarized = time;
    this._wasKnown = isKnown;
    const angles = `${degrees(arm.theta1)} and ${degrees(arm.theta2)}`;
    const links = `Links of ${number(arm.l1, digitsOf(arm.l1))} and ${number(arm.l2, digitsOf(arm.l2))} metres, joints at ${angles}.`;
    const effector = position ? ` Effector at x ${number(position.x, this._digits)}, y ${number(position.y, this._digits)} metres.` : "";
    const isOld = this._svg.dataset.current === "no";
    const lag = isOld ? " This position is old: it does not follow the joints." : "";
    setText(byId("arm-summary"), isKnown ? links + effector + lag : "The configuration is not known.");
  }
}

/**
 * Where the two angles are written.
 *
 * @param {number} one direction of link one [rad]
 * @param {number} theta2 angle of the second joint [rad]
 * @param {[number, number]} elbow in units of the drawing
 */
export function labelPlaces(one, theta2, elbow) {
  // Next to the elbow, where no link is.
  const free = one + (wrap(theta2) - Math.PI) / 2 + (wrap(theta2) > 0 ? 0 : Math.PI);
  const two = [elbow[0] + 26 * Math.cos(free), elbow[1] - 13 * Math.sin(free)];
  // Next to the x axis, where link one is not, and where its arc begins; further out where the other label is.
  const side = Math.sin(one) < 0 ? -1 : 1;
  const y = side < 0 ? -7 : 9;
  const isTaken = Math.abs(two[0] - 38) < LABEL.width && Math.abs(two[1] - y) < LABEL.height;
  return [[38, isTaken ? two[1] + side * LABEL.height : y], two];
}

function line(link, from, to) {
  ends(link.outer, from, to);
  ends(link.inner, from, to);
}

function ends(element, [x1, y1], [x2, y2]) {
  setAttributes(element, { x1: x1.toFixed(2), y1: y1.toFixed(2), x2: x2.toFixed(2), y2: y2.toFixed(2) });
}

/** Draw an arc around a point, from a direction over an angle [rad]. */
function arc(element, [cx, cy], from, by, radius) {
  const turn = wrap(by); // full turns are not drawn
  const at = (direction) =>
    `${(cx + radius * Math.cos(direction)).toFixed(2)} ${(cy - radius * Math.sin(direction)).toFixed(2)}`;
  setAttributes(element, { d: `M${at(from)}A${radius} ${radius} 0 0 ${turn > 0 ? 0 : 1} ${at(from + turn)}` });
}

/** An angle [rad] between −π and π. */
const wrap = (angle) => Math.atan2(Math.sin(angle), Math.cos(angle));

function circle(radius) {
  const r = radius.toFixed(2);
  return `M${r} 0A${r} ${r} 0 1 0 -${r} 0A${r} ${r} 0 1 0 ${r} 0Z`;
}
