/** The lines that the terminal prints, newest first, of the kinds that the user wants to see. */

import { byId, create, onActivate, setAttributes } from "./dom.js";

const MOST = 200; // of each group: positions come fast, and must not push out what matters

/** The groups of kinds that a button shows and hides. */
const GROUPS = {
  steady: ["data", "position", "speed", "signal", "alive"],
  operator: ["missed", "asleep", "hand"],
  engines: ["engines", "turn_off", "state"],
  processes: ["service", "process"],
};
const GROUP_OF = Object.fromEntries(
  Object.entries(GROUPS).flatMap(([group, kinds]) => kinds.map((kind) => [kind, group])),
);

export class Lines {
  constructor() {
    this._list = byId("lines");
    for (const button of byId("line-kinds").children) {
      const group = button.dataset.shows;
      const show = (isShown) => {
        setAttributes(button, { "aria-pressed": isShown });
        this._list.classList.toggle(`without-${group}`, !isShown);
      };
      show(button.ariaPressed === "true");
      onActivate(button, () => show(button.ariaPressed !== "true"));
    }
  }

  clear() {
    this._list.replaceChildren();
  }

  /** Add lines above the others, and drop the oldest ones of each group. */
  add(lines) {
    if (!lines.length) return;
    const items = lines.map(({ time, kind, text }) => {
      const attributes = { "data-kind": kind, "data-group": GROUP_OF[kind] };
      return create("li", attributes, create("span", { class: "time" }, `[${Math.round(time)}]`), ` ${text}`);
    });
    this._list.prepend(...items.reverse());
    for (const group of Object.keys(GROUPS)) {
      for (const old of [...this._list.querySelectorAll(`[data-group=${group}]`)].slice(MOST)) old.remove();
    }
  }
}
