/** Plays the last seconds before the engines stopped: the arm and the plots in step, with the cause. */

import { announce } from "./announce.js";
import { byId, onActivate, setAttributes, setNote, setText } from "./dom.js";
import { number, sentence } from "./format.js";
import { RecordLink } from "./record.js";
import { Rows } from "./ring.js";

const BEFORE = 10; // s before the stop
const AFTER = 1; // s after it
const HISTORIES = ["hands", "operators", "strikes", "engineStates"];

export class Rewind {
  constructor() {
    /** What was seen of the last stop. */
    this._stop = null;
    /** When the replay began [ms]; null while none plays. */
    this._began = null;
    this._button = byId("rewind");
    this._record = new RecordLink();
    onActivate(this._button, () => (this._began === null ? this._play() : this.end()));
  }

  /** Keep what surrounds the last stop, once its end is known. */
  note({ engineStates: { items }, trace, time, arm, engines, welcome, ...histories }) {
    if (this._began !== null) return;
    const index = items.findLastIndex((it) => it[1] === "off");
    const at = items[index]?.[0];
    const wasOn = items.slice(0, Math.max(0, index)).findLast((it) => it[1] !== null)?.[1] === "on";
    if (!wasOn || at === this._stop?.at) return;
    this._stop = null; // an earlier one is not the last any more
    this._record.forget();
    if (time < at + AFTER) return;
    const isNear = ([when]) => when <= at + AFTER;
    const samples = [];
    for (let row = trace.from(at - BEFORE); row < trace.length && trace.at(row, 0) <= at + AFTER; row += 1) {
      samples.push([0, 1, 2, 3, 4, 5].map((column) => trace.at(row, column)));
    }
    const kept = { ...histories, engineStates: { items } };
    const changes = HISTORIES.map((name) => [name, kept[name].items.filter(isNear)]);
    this._stop = { at, samples, arm, welcome, why: engines.why, changes };
  }

  /** Offer a replay, or end it, because what happens now is more important. */
  allow(isAllowed) {
    this._button.hidden = !isAllowed || !this._stop?.samples.length;
    this._record.allow(!this._button.hidden);
    if (!isAllowed) this.end();
  }

  /** End the replay: what is shown is now. */
  end() {
    if (this._began === null) return;
    this._began = null;
    this._show("");
    announce("The replay has ended.");
  }

  /**
   * What the page showed at this moment of the replay, in the form of a model; null while none plays.
   *
   * @param {number} now [ms]
   */
  frame(now) {
    if (this._began === null) return null;
    const { at, samples, arm, welcome, why, changes } = this._stop;
    const time = at - BEFORE + (now - this._began) / 1000;
    if (time > at + AFTER) {
      this.end();
      return null;
    }
    while (this._next < samples.length && samples[this._next][0] <= time) this._trace.push(samples[this._next++]);
    const [, x, y, speed, theta1, theta2] = samples[Math.max(0, this._next - 1)].map((it) => (Number.isNaN(it) ? null : it));
    const past = Object.fromEntries(changes.map(([name, items]) => [name, { items: items.filter((it) => it[0] <= time) }]));
    const last = (name) => past[name].items.at(-1)?.[1] ?? null;
    const left = at - time;
    this._show(left > 0 ? `Replay: ${number(left, 1)} s before the engines stopped.` : `Replay: ${sentence(why || "stopped")}`);
    return {
      present: "then",
      welcome,
      time,
      trace: this._trace,
      arm: { ...arm, theta1, theta2 },
      position: x === null ? null : { x, y },
      speed,
      unheard: [],
      ...past,
      switch: { held: last("hands") !== "released" },
      operator: { seen: last("operators") === "seen" },
      engines: { state: last("engineStates"), since: at },
    };
  }

  _play() {
    this._began = performance.now();
    this._next = 0;
    this._trace = new Rows(this._stop.samples.length, 6);
    announce("Replay of the last stop.");
    this._record.find(this._stop.at);
  }

  _show(text) {
    setAttributes(document.documentElement, { "data-replay": text ? "yes" : null });
    setNote(byId("replay-note"), text);
    setText(this._button, text ? "Back to now" : "Replay the last stop");
  }
}
