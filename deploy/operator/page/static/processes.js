/** The table of processes: what runs, what was restarted, and buttons that break them. */

import { alert, announce } from "./announce.js";
import { confirmByHolding } from "./confirm.js";
import { byId, create, setAttributes, setNote, setText } from "./dom.js";
import { duration, sentence } from "./format.js";

const REMEMBERED = 20; // s for which a row shows that its process came back
const UNSEEN = { process: null, goodPid: null, isDown: false, backAt: null };
const ACTIONS = {
  kill: "Kill",
  stop: "Stop",
};
const HELP_LOCAL =
  "Break a process and watch it heal. Hold a button for a second: Kill ends the process at once, Stop freezes it. " +
  "The supervisor and the sentinel bring it back.";
const HELP_REMOTE =
  "The supervisor and the sentinel bring back what ends or hangs. Kill and Stop work only on the machine itself.";

export class Processes {
  /** @param {(message: object) => boolean} send */
  constructor(send) {
    this._send = send;
    this._rows = new Map();
    this._drawn = null;
  }

  render({ processes, welcome, time }, isLive) {
    if (welcome) this._begin(welcome);
    for (const process of processes) {
      if (!this._rows.has(process.name)) this._build(process.name);
      this._update(this._rows.get(process.name), process, time);
    }
    if (isLive !== this._isLive) {
      this._isLive = isLive;
      for (const entry of this._rows.values()) {
        if (!isLive) this._forget(entry);
        for (const button of entry.buttons) setAttributes(button, { "aria-disabled": isLive ? null : true });
      }
    }
  }

  refuse(why) {
    this._note(`Not done. ${sentence(why)}`);
  }

  _begin(welcome) {
    if (welcome === this._welcome) return;
    this._welcome = welcome;
    setAttributes(byId("services"), { "data-local": welcome.local ? "yes" : "no" });
    setText(byId("process-help"), welcome.local ? HELP_LOCAL : HELP_REMOTE);
    for (const name of welcome.programs) if (!this._rows.has(name)) this._build(name);
    // What happened while this page was not connected is not known: nothing has come back.
    for (const entry of this._rows.values()) Object.assign(entry, UNSEEN);
  }

  _build(name) {
    const cell = (column, ...children) => create("td", { "data-column": column }, ...children);
    const sign = create("span", { class: "sign", "data-sign": "idle", "aria-hidden": "true" });
    const state = create("span", {}, "not known");
    const host = create("small", { class: "muted" });
    const cells = { restarts: cell("restarts"), output: cell("output"), health: cell("health") };
    const buttons = Object.entries(ACTIONS).map(([action, label]) => {
      const attributes = { type: "button", "data-action": action, "aria-label": `${label} ${name}` };
      const button = create("button", attributes, label);
      confirmByHolding(
        button,
        () => this._act(name, action),
        () => this._note(`Not done. Hold ${label} for a second.`),
      );
      return button;
    });
    const row = create(
      "tr",
      { "data-process": name },
      create("th", { scope: "row" }, ...breakable(name), host),
      cell("state", sign, state),
      cells.restarts,
      cells.output,
      cells.health,
      create("td", { class: "local", "data-column": "actions" }, ...buttons),
    );
    byId("processes").tBodies[0].append(row);
    this._rows.set(name, { row, host, sign, state, ...cells, buttons, ...UNSEEN });
  }

  _update(entry, process, time) {
    const isGood = process.ok && process.state === "RUNNING";
    if (isGood) {
      if (entry.goodPid !== null && (entry.isDown || entry.goodPid !== process.pid)) {
        entry.backAt = time;
        announce(`${process.name} is back.`);
      }
      entry.goodPid = process.pid;
    }
    entry.isDown = !isGood && entry.goodPid !== null;
    if (process !== entry.process) {
      setAttributes(entry.row, { "data-ok": process.ok ? "yes" : "no", "data-state": process.state.toLowerCase() });
      setAttributes(entry.sign, { "data-sign": isGood ? "good" : process.state === "STARTING" ? "warn" : "bad" });
      setText(entry.state, !process.ok && process.state === "RUNNING" ? "unhealthy" : process.state.toLowerCase());
      setText(entry.host, process.host);
      setText(entry.restarts, String(process.restarts));
    }
    if (process !== entry.process || !process.ok) {
      setText(entry.output, process.output === null ? "–" : `${duration(time - process.output)} ago`);
    }
    const isBack = entry.backAt !== null && time - entry.backAt < REMEMBERED;
    setAttributes(entry.row, { "data-back": isBack ? "yes" : null });
    setText(entry.health, isBack && process.ok ? "is back" : complaint(process));
    entry.process = process;
  }

  _forget(entry) {
    entry.process = null;
    setAttributes(entry.row, { "data-ok": null, "data-state": "unknown", "data-back": null });
    setAttributes(entry.sign, { "data-sign": "idle" });
    for (const [cell, text] of [[entry.state, "unknown"], [entry.output, "–"], [entry.health, ""]]) setText(cell, text);
  }

  _act(name, action) {
    if (!this._send({ type: "process", name, action })) {
      this._note("Not done. The page was not connected at that moment.");
      return;
    }
    this._note("");
    announce(`${name}: ${action} was sent.`);
  }

  _note(text) {
    setNote(byId("process-note"), text);
    if (text) alert(text);
  }
}

/** Why a process is not healthy; a healthy one has nothing to add to its state. */
const complaint = ({ ok, health }) => (ok ? "" : health);

/** A name that may be broken after an underscore where there is little room. */
function breakable(name) {
  return name.split(/(?<=_)/).flatMap((part, index) => (index ? [create("wbr"), part] : [part]));
}
