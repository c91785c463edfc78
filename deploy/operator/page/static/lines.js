/** The lines that the terminal prints, newest first. */

import { byId, create } from "./dom.js";

const MOST = 200;

export class Lines {
  constructor() {
    this._list = byId("lines");
  }

  clear() {
    this._list.replaceChildren();
  }

  /** Add lines above the others, and drop the oldest ones. */
  add(lines) {
    if (!lines.length) return;
    const items = lines.map(({ time, kind, text }) =>
      create("li", { "data-kind": kind }, create("span", { class: "time" }, `[${Math.round(time)}]`), ` ${text}`),
    );
    this._list.prepend(...items.reverse());
    while (this._list.childElementCount > MOST) this._list.lastElementChild.remove();
  }
}
