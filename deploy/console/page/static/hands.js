/** What hands do: pointers, keys, gamepads and the life of the page, as events of the hold. */

const TRIGGERS = [6, 7]; // of the standard gamepad
const PRESSED = 0.6; // of a trigger's way; below RELEASED it is let go
const RELEASED = 0.4;
/** Keys after which some systems do not tell that another key is let go. */
const THIEVES = new Set(["Meta", "Alt", "F10"]);

/**
 * Listen to everything that holds or releases.
 *
 * @param {HTMLElement} button
 * @param {(event: object) => void} feed takes the events of hold.js
 * @param {() => boolean} isHeld
 * @returns {() => void} polls the gamepads, which have no events for their triggers
 */
export function listen(button, feed, isHeld) {
  listenToPointers(button, feed);
  listenToKeys(button, feed);
  listenToPage(button, feed, isHeld);
  return gamepads(feed);
}

function listenToPointers(button, feed) {
  const hand = (event) => `pointer ${event.pointerId}`;
  const up = (event) => feed({ type: "up", hand: hand(event) });

  button.addEventListener("pointerdown", (event) => {
    if (event.button !== 0) return;
    button.setPointerCapture(event.pointerId);
    feed({ type: "down", hand: hand(event) });
  });
  for (const type of ["pointerup", "pointercancel", "lostpointercapture"]) button.addEventListener(type, up);
  button.addEventListener("pointermove", (event) => {
    if (event.pointerType === "mouse" && !(event.buttons & 1)) up(event); // its pointerup was lost
  });
  // Keeps a long touch from becoming a gesture: selection, context menu, scrolling.
  button.addEventListener("touchstart", (event) => event.preventDefault(), { passive: false });
}

function listenToKeys(button, feed) {
  const down = new Set(); // keys that pressed, as long as they are down
  const hand = (event) => `key ${event.code}`;

  button.addEventListener("keydown", (event) => {
    if (event.key !== " " && event.key !== "Enter") return;
    event.preventDefault();
    if (event.repeat || event.ctrlKey || event.altKey || event.metaKey) return;
    down.add(event.code);
    feed({ type: "down", hand: hand(event) });
  });
  // At the window, because focus may move on while the key is down: hold Space, Tab to "Turn on", Enter.
  window.addEventListener(
    "keydown",
    (event) => {
      if (THIEVES.has(event.key)) feed({ type: "lost", why: "another key took over the keyboard" });
      if (down.has(event.code) && event.target !== button) swallow(event);
    },
    true,
  );
  window.addEventListener(
    "keyup",
    (event) => {
      if (!down.delete(event.code)) return;
      swallow(event);
      feed({ type: "up", hand: hand(event) });
    },
    true,
  );
  window.addEventListener("blur", () => down.clear());
}

function swallow(event) {
  event.preventDefault();
  event.stopPropagation();
}

function listenToPage(button, feed, isHeld) {
  const lost = (why) => feed({ type: "lost", why });
  window.addEventListener("blur", () => lost("the window lost focus"));
  window.addEventListener("pagehide", () => lost("the page was left"));
  window.addEventListener("pageshow", () => lost("the page was left"));
  document.addEventListener("freeze", () => lost("the page was put to sleep"));
  document.addEventListener("visibilitychange", () => {
    if (document.visibilityState !== "visible") lost("the page was hidden");
  });
  window.addEventListener("contextmenu", (event) => {
    const onButton = button.contains(event.target);
    const secondFinger = event.pointerType === "touch" && !onButton && isHeld();
    if (onButton || secondFinger) event.preventDefault();
    if (!secondFinger) lost("a context menu opened");
  });
}

function gamepads(feed) {
  const pressed = new Map(); // by index; a trigger that is found pressed has to be let go first
  const hand = (index) => `gamepad ${index}`;

  window.addEventListener("gamepadconnected", ({ gamepad }) => pressed.set(gamepad.index, true));
  window.addEventListener("gamepaddisconnected", ({ gamepad }) => {
    pressed.delete(gamepad.index);
    feed({ type: "up", hand: hand(gamepad.index), why: "the gamepad was disconnected" });
  });

  return () => {
    if (!pressed.size) return;
    const pads = navigator.getGamepads();
    for (const [index, before] of pressed) {
      const now = way(pads[index]) > (before ? RELEASED : PRESSED);
      pressed.set(index, now);
      if (now && !before && document.hasFocus()) feed({ type: "down", hand: hand(index) });
      if (!now && before) feed({ type: "up", hand: hand(index) });
    }
  };
}

/** How far a trigger of a gamepad is pressed; 0 for a gamepad that is gone or has none. */
function way(pad) {
  if (!pad?.connected || pad.mapping !== "standard") return 0;
  return Math.max(...TRIGGERS.map((index) => pad.buttons[index].value));
}
