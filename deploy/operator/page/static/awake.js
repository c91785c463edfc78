/** Keeps the screen on while a hand holds: a screen that sleeps releases. */

let isWanted = false;
let lock = null;

/** @param {boolean} isHeld */
export async function stayAwake(isHeld) {
  isWanted = isHeld;
  try {
    if (isWanted) lock ??= await navigator.wakeLock?.request("screen");
  } catch {
    return; // the system saves its battery
  }
  if (isWanted) return;
  lock?.release();
  lock = null;
}
