/** Announces to a screen reader what matters, each change once. */

import { byId } from "./dom.js";

const SAID = 10_000; // ms after which a text is out of date, and nobody should find it any more

const polite = byId("announce");
const assertive = byId("alert");

/** Say it when the reader has time. */
export const announce = (text) => say(polite, text);

/** Interrupt the reader. */
export const alert = (text) => say(assertive, text);

function say(region, text) {
  // A new element is read even when the text is the same as before.
  const line = document.createElement("p");
  line.textContent = text;
  region.replaceChildren(line);
  setTimeout(() => line.remove(), SAID);
}

/**
 * Call an action when a value differs from the one before; the first value is no change.
 *
 * @param {(value: any, before: any) => void} action
 */
export function onChange(action) {
  let known = false;
  let before;
  return (value) => {
    if (known && value !== before) action(value, before);
    known = true;
    before = value;
  };
}
