/** The newest state that the server sent, and what happened in the last minute. */

import { Changes, Rows } from "./ring.js";

export const SPAN = 60; // s of history
const SAMPLES = SPAN * 30; // the server sends at most 30 a second
const MOST_LINES = 400;
/** Without a change for this time [s], a plot shows a gap. */
export const GAP = 1.5;

const KEYS = ["time", "arm", "position", "speed", "unheard", "operator", "switch", "engines", "sources", "processes"];

/** What is known without a word from the server. */
export const INITIAL = {
  /** The word for the time of all that. */
  present: "now",
  time: NaN,
  arm: { l1: null, l2: null, theta1: null, theta2: null },
  position: null,
  speed: null,
  /** The values of the arm, and `position`, that are known no more. */
  unheard: [],
  operator: { seen: null, age: null, activity: null, strikes_left: null },
  switch: { held: false, by: null },
  engines: { state: null, why: "", refused: null, stops_in: null },
  sources: {},
  processes: [],
};

export class Model {
  constructor() {
    /** What the server said about itself at the begin of the connection. */
    this.welcome = null;
    /** Samples [time, x, y, speed, theta1, theta2]. */
    this.trace = new Rows(SAMPLES, 6);
    this.hands = new Changes(SPAN);
    this.operators = new Changes(SPAN);
    /** How many strikes fell. */
    this.strikes = new Changes(SPAN);
    this.engineStates = new Changes(SPAN);
    this._histories = [this.hands, this.operators, this.strikes, this.engineStates];
    /** Lines that are not shown yet. */
    this.lines = [];
    Object.assign(this, INITIAL);
  }

  /** Begin again after a connection; the last minute stays, with a gap. A new page gets it from the server. */
  begin(welcome) {
    this.welcome = welcome;
    this.lines = [];
    Object.assign(this, INITIAL, { time: this.time });
    // Until then, this page knows more: which hand was its own. The server has seen the rest.
    const known = this.hands.items.length ? this.time : -Infinity;
    const history = welcome.history ?? [];
    if (Number.isFinite(known) && history[0]?.[0] > known + GAP) this._gap(known);
    for (const [time, moment] of history.filter((it) => it[0] > known)) {
      if (moment) this._note(time, moment);
      else this._gap(time);
    }
    this._isFilled = history.length > 0;
  }

  /** Take over what changed. */
  update(message) {
    if (message.time < this.time - 1) this._forget(); // another scenario
    const before = this.time;
    for (const key of KEYS) if (key in message) this[key] = message[key];
    if (this.time - before > GAP && !this._isFilled) this._gap(before);
    this._isFilled = false;
    for (const sample of message.trace ?? []) this._trace(sample);
    if (message.lines) this.lines = this.lines.concat(message.lines).slice(-MOST_LINES);
    this._note(this.time, this);
  }

  _note(time, { switch: hold, operator, engines }) {
    this.hands.push(time, hold.held ? (hold.by ?? "somewhere") : "released");
    this.operators.push(time, operatorState(operator));
    this.strikes.push(time, this._strikesFallen(operator));
    this.engineStates.push(time, engines.state);
  }

  /** The lines that came since the last call. */
  takeLines() {
    const lines = this.lines;
    this.lines = [];
    return lines;
  }

  _strikesFallen({ strikes_left: left }) {
    return left === null || !this.welcome ? null : this.welcome.strikes - left;
  }

  _trace(sample) {
    const { length } = this.trace;
    const isNew = !length || sample[0] > this.trace.at(length - 1, 0);
    if (isNew) this.trace.push(sample);
  }

  _gap(time) {
    for (const history of this._histories) history.push(time, null);
  }

  _forget() {
    for (const history of [this.trace, ...this._histories]) history.clear();
  }
}

/** The operator as one word: `seen`, `missed`, `unseen`, `incapacitated`; null where nothing is known. */
export function operatorState(operator) {
  if (operator.seen) return "seen";
  if (operator.activity === "incapacitated") return "incapacitated";
  if (operator.activity === "missed") return "missed";
  return operator.seen === null ? null : "unseen";
}
