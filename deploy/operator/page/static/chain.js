/** The chain that keeps the engines on: the messages between its nodes, and who makes the arm safe without a node. */

import { alert, announce } from "./announce.js";
import { confirmByHolding } from "./confirm.js";
import { byId, create, draw, setAttributes, setText } from "./dom.js";
import { number, sentence } from "./format.js";

const SPAN = { wide: 2, narrow: 1 }; // s that a message takes along a line
const PERIOD = 0.1; // s between two marks of a stream that is faster
const REMEMBERED = 20; // s for which a node shows that it came back
const SWIFT = 0.05; // s after a kill in which its victim may still have sent something

const NODES = [
  { name: "hand", title: "Hand" },
  { name: "watchdog", title: "Watchdog", program: "operator_watchdog" },
  { name: "controller", title: "Controller", program: "engine_controller" },
  { name: "drive", title: "Drive", program: "drive" },
  { name: "arm", title: "Arm", program: "kinematics" },
];
const HANDS = { this_page: "You hold", other_page: "Another page", terminal: "The terminal", dead_mans_switch: "The scenario" };

const wide = matchMedia("(min-width: 43.75rem)");

/**
 * Who makes the arm safe, and when: now, or without a node.
 *
 * @param {object} model
 * @param {string} [without] the name of a node
 * @returns {[string, string]} the name of the node that acts, and a sentence
 */
export function failSafe({ operator, engines, switch: hold, welcome }, without = "") {
  const { presence_timeout: limit, on_lasts: lasts } = welcome;
  const isOn = engines.state === "on";
  const left = (seconds) => (isOn && seconds !== null ? `in ${Math.ceil(Math.max(0, seconds))} s` : "");
  if (without === "arm") return ["watchdog", "The engines do not need this process. Without it, nobody knows where the arm is."];
  if (without === "drive") return ["arm", "Without the drive, nothing moves the joints."];
  if (without === "controller" || engines.state === null) {
    return ["drive", `Without the controller, the drive stands still after ${lasts} s.`];
  }
  if (without === "watchdog") {
    const end = left(operator.age === null ? null : limit - operator.age);
    return ["controller", `Without the watchdog, the controller turns the engines off ${end || `${limit} s later`}.`];
  }
  if (!isOn) return ["drive", "The engines are off: the drive moves nothing."];
  const end = left(engines.stops_in) || "soon";
  const what = `the watchdog turns the engines off ${end}`;
  return ["watchdog", hold.held ? `Let go, and ${what}.` : `Nobody holds: ${what}.`];
}

/** How long the process of a node was away, from the rows of the table of processes. */
export class Away {
  constructor() {
    this._pid = 0;
    this._output = null;
    this._isKilled = false;
    this.forget();
  }

  forget() {
    this.since = null; // time of the scenario
    this.back = -Infinity; // when it was back
    this.words = "";
  }

  kill(time) {
    this.forget();
    this.since = time;
    this._isKilled = true;
  }

  /** Take a row; return whether the process has just come back. */
  see({ pid, output, ok, state }, time) {
    const isAnother = pid !== this._pid && this._pid !== 0;
    if (this.since === null && (isAnother || (this._pid !== 0 && !(ok && /RUNNING|STARTING/.test(state))))) {
      this.kill(this._output ?? time);
      this._isKilled = false;
    }
    const isHeard = this.since !== null && output > this.since + SWIFT;
    const isBack = this.since !== null && isAnother && pid !== 0 && (isHeard || (ok && state === "RUNNING"));
    if (isBack) {
      const took = (isHeard ? output : time) - this.since;
      this.words = `back ${this._isKilled && isHeard ? "in" : "within"} ${number(took, 2)} s`;
      this.back = time;
    }
    if (isBack || this.since === null) {
      this.since = null;
      this._pid = pid;
      this._output = output;
    }
    return isBack;
  }
}

export class Chain {
  /** @param {(message: object) => boolean} send */
  constructor(send) {
    this._send = send;
    this._presence = -Infinity; // time of the last one
    this._looked = ""; // name of the node whose button is looked at
    this._note = "";
    this._nodes = NODES.map((node) => this._build(node));
    wide.addEventListener("change", () => this._turn());
    this._turn();
  }

  /** Take note of the messages in an update. */
  note({ time, operator, switch: hold, engines, speed }) {
    this._time = time;
    this._noted = performance.now();
    const presence = time - (operator.age ?? Infinity);
    const isNew = presence > this._presence + PERIOD;
    if (isNew) this._presence = presence;
    const states = { on: "strong", off: "weak" };
    const [hand, watchdog, controller, drive] = this._nodes;
    mark(hand, time, hold.held && "strong");
    mark(watchdog, presence, isNew && "strong");
    mark(controller, time, states[engines.state]);
    mark(drive, time, speed !== null && states[speed > 0 ? "on" : "off"]);
  }

  render(model, isLive) {
    const { welcome, processes, time } = model;
    if (welcome && welcome !== this._welcome) this._begin(welcome);
    if (!isLive) for (const node of this._nodes) node.away = new Away();
    const words = isLive ? wordsOf(model) : {};
    let without = this._looked;
    for (const { name, title, program, box, sign, text, stamp, lines, marks, away } of this._nodes) {
      const row = processes.find((it) => it.name === program);
      if (isLive && row && away.see(row, time)) announce(`${title}: ${away.words}.`);
      const isStamped = time - away.back < REMEMBERED;
      if (away.since !== null || isStamped) without = name;
      const [state, shown] = away.since === null ? (words[name] ?? ["idle", "unknown"]) : ["bad", "killed"];
      setAttributes(box, { "data-away": away.since === null ? null : "yes" });
      setAttributes(sign, { "data-sign": state });
      setText(text, shown);
      setText(stamp, isStamped ? away.words : "");
      for (const kind of Object.keys(lines)) {
        const d = isLive ? path(marks.filter((it) => it[1] === kind), time) : "";
        setAttributes(lines[kind], { d });
      }
    }
    const [acts, why] = isLive && welcome ? failSafe(model, without) : ["", "Not connected."];
    for (const { name, box } of this._nodes) setAttributes(box, { "data-acts": name === acts ? "yes" : null });
    setText(byId("chain-safe"), this._note || why);
  }

  refuse(why) {
    for (const node of this._nodes) node.away = new Away();
    this._tell(`Not done. ${sentence(why)}`);
  }

  _begin(welcome) {
    this._welcome = welcome;
    setAttributes(byId("chain"), { "data-local": welcome.local ? "yes" : "no" });
    for (const { program, kill } of this._nodes) if (kill) kill.hidden = !welcome.programs.includes(program);
  }

  _build({ name, title, program }) {
    const sign = create("span", { class: "sign", "aria-hidden": "true" });
    const text = create("span", { class: "muted" });
    const stamp = create("span", { class: "stamp" });
    const words = create("p", {}, create("b", {}, title), text, stamp);
    const box = create("li", { "data-node": name }, sign, words);
    const node = { name, title, program, box, sign, text, stamp, lines: {}, marks: [], away: new Away() };
    if (name !== "arm") {
      node.svg = draw(box, "svg", { preserveAspectRatio: "none", "aria-hidden": "true" });
      for (const kind of ["strong", "weak"]) node.lines[kind] = draw(node.svg, "path", { class: kind });
    }
    if (program) node.kill = box.appendChild(this._buildKill(node));
    byId("links").append(box);
    return node;
  }

  _buildKill(node) {
    const { name, title, program } = node;
    const hint = `Ends the process ${program}, which starts again`;
    const kill = create("button", { type: "button", class: "local", "data-action": "kill", "aria-label": `${title}: kill`, title: hint }, "Kill");
    confirmByHolding(kill, () => this._kill(node), () => this._tell("Not done. Hold Kill for a second."));
    const look = (looked) => () => {
      this._looked = looked;
      this._note = "";
    };
    for (const type of ["pointerenter", "focus"]) kill.addEventListener(type, look(name));
    for (const type of ["pointerleave", "blur"]) kill.addEventListener(type, look(""));
    return kill;
  }

  _kill({ title, program, away, box }) {
    if (!this._send({ type: "process", name: program, action: "kill" })) {
      this._tell("Not done. The page was not connected at that moment.");
      return;
    }
    away.kill(this._time + (performance.now() - this._noted) / 1000);
    setAttributes(box, { "data-away": "yes" }); // it may be back before the next drawing
    this._note = "";
    announce(`${title}: kill was sent.`);
  }

  _tell(text) {
    this._note = text;
    alert(text);
  }

  _turn() {
    for (const { svg } of this._nodes) if (svg) setAttributes(svg, { viewBox: wide.matches ? "0 0 100 4" : "0 0 4 100" });
  }
}

/** What the nodes say: a sign and some words of each. */
function wordsOf({ operator, switch: hold, engines, speed }) {
  const left = operator.strikes_left;
  const isOn = engines.state === "on";
  return {
    hand: hold.held ? ["good", HANDS[hold.by] ?? hold.by ?? "Somebody"] : ["idle", "Nobody holds"],
    watchdog: left === null ? ["idle", "Strikes unknown"] : [left ? "good" : "bad", `${left} ${left === 1 ? "strike" : "strikes"} left`],
    controller: engines.state === null ? ["bad", "No word"] : isOn ? ["good", "Engines on"] : ["idle", "Engines off"],
    drive: isOn ? ["good", "Moves joints"] : ["idle", "Holds still"],
    arm: speed === null ? ["warn", "No news"] : speed > 0 ? ["good", `${number(speed, 1)} m/s`] : ["idle", "Stands"],
  };
}

/** Note that a message left a node at a time, if one of this kind did. */
function mark({ marks }, time, kind) {
  if (kind && !(time - marks.at(-1)?.[0] < PERIOD * 0.9)) marks.push([time, kind]);
  while (marks[0]?.[0] < time - SPAN.wide) marks.shift();
}

/** A line of messages: each moves away from its node. */
function path(marks, time) {
  const span = wide.matches ? SPAN.wide : SPAN.narrow;
  const places = marks.map(([at]) => ((time - at) / span) * 100).filter((place) => place >= 0 && place <= 100);
  return places.map((place) => (wide.matches ? `M${place.toFixed(1)} 2h2.5` : `M2 ${place.toFixed(1)}v5`)).join("");
}
