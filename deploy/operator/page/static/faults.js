/** Errors of the page's own code: a banner shows them, and the server writes them to its log, each once. */

import { byId, setText } from "./dom.js";

const MOST = 10; // that one page reports
const LONGEST = 300; // characters

const reported = new Set();
const unsent = [];

/** The errors that the server does not know yet. */
export const takeFaults = () => unsent.splice(0);

function report(error) {
  const text = `${error?.stack ?? error}`.replace(/[\p{Cc}\s"\\]+/gu, " ").slice(0, LONGEST);
  if (reported.has(text) || reported.size === MOST) return;
  reported.add(text);
  unsent.push(text);
  setText(byId("fault-text"), text);
  byId("fault").hidden = false;
  scrollTo(0, 0);
}

// An error without an object is not from this page's code, for example a delayed ResizeObserver.
addEventListener("error", ({ error }) => error && report(error));
addEventListener("unhandledrejection", ({ reason }) => report(reason));
