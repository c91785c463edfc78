/** The link to the record of the last stop, if the arm was recorded: an MCAP for Foxglove and `ros2 bag`. */

import { byId, setNote, setText } from "./dom.js";
import { takeToken } from "./token.js";

const SLACK = 1; // s: page and recorder heard of the stop at different times

export class RecordLink {
  constructor() {
    this._link = byId("record");
    this._link.addEventListener("click", (event) => {
      if (this._link.protocol === "blob:") return;
      event.preventDefault(); // the server gives it only with the token
      this._save().catch(() => setNote(byId("record-note"), "The record did not arrive."));
    });
  }

  /** Show the link while it is of use. */
  allow(isAllowed) {
    this._link.hidden = !isAllowed || !this._name;
  }

  /** The link is of an earlier stop. */
  forget() {
    this._name = null;
    setNote(byId("record-note"), "");
  }

  /** Look for the record of a moment [s of the scenario]. */
  async find(at) {
    this.forget();
    const answer = await ask("records").catch(() => null);
    const records = answer?.ok ? await answer.json() : [];
    const found = records.find(({ begin, end }) => begin - SLACK <= at && at <= end + SLACK);
    if (!found) return;
    this._name = found.name;
    this._link.download = found.name;
    this._link.href = `records/${found.name}`;
    setText(this._link, `Save its record, ${found.name}`);
  }

  /** Save what the record has now: that of a stop ends ten seconds after it. */
  async _save() {
    const answer = await ask(this._link.getAttribute("href"));
    if (!answer.ok) throw new Error(answer.statusText);
    const { href } = this._link;
    this._link.href = URL.createObjectURL(await answer.blob());
    this._link.click();
    setTimeout(URL.revokeObjectURL, 60_000, this._link.href);
    this._link.href = href;
  }
}

const ask = (path) =>
  fetch(new URL(path, location.href.split("#")[0]), { headers: { Authorization: `Bearer ${takeToken()}` } });
