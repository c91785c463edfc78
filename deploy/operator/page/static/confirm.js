/** Buttons that act only after they were held for a moment, so that no stray click breaks anything. */

import { announce } from "./announce.js";

export const HOLD = 800; // ms
const ARMED = 5000; // ms in which a second activation by assistive technology confirms

/**
 * Make a button act after it was held by pointer, Space or Enter. A screen reader, which clicks but cannot hold,
 * confirms by a second click.
 *
 * @param {HTMLButtonElement} button
 * @param {() => void} act
 * @param {() => void} hint called when a hand let go too early
 */
export function confirmByHolding(button, act, hint) {
  let timer = 0;
  let isPressed = false; // by a hand: the click that follows is no activation
  let armedUntil = -Infinity;

  const begin = () => {
    if (button.ariaDisabled === "true") return;
    isPressed = true;
    button.dataset.confirming = "yes";
    timer = setTimeout(() => {
      clear();
      act();
    }, HOLD);
  };
  const clear = () => {
    clearTimeout(timer);
    delete button.dataset.confirming;
  };
  const end = () => {
    if (button.dataset.confirming) hint();
    clear();
  };

  button.addEventListener("pointerdown", (event) => event.button === 0 && begin());
  button.addEventListener("touchstart", (event) => event.preventDefault(), { passive: false });
  for (const type of ["pointerup", "pointerleave", "pointercancel", "blur"]) button.addEventListener(type, end);
  button.addEventListener("keydown", (event) => {
    if (event.key !== " " && event.key !== "Enter") return;
    event.preventDefault();
    if (!event.repeat) begin();
  });
  button.addEventListener("keyup", () => {
    end();
    isPressed = false;
  });
  button.addEventListener("click", () => {
    const isByHand = isPressed;
    isPressed = false;
    if (isByHand || button.ariaDisabled === "true") return;
    if (performance.now() < armedUntil) {
      armedUntil = -Infinity;
      act();
    } else {
      armedUntil = performance.now() + ARMED;
      announce(`Activate again to confirm: ${button.ariaLabel ?? button.textContent}.`);
    }
  });
}
