/** What hands do: pointers, keys, gamepads and the life of the page, as events of the hold. */

const TRIGGERS = [6, 7]; // of the standard gamepad
const PRESSED = 0.6; // of a trigger's way; below RELEASED it is let go
const RELEASED = 0.4;
const SLIP = 8; // px beside the button that still hold
/** Keys after which some systems do not report that another key is let go. */
const THIEVES = new Set(["Meta", "Alt", "F10"]);

// How long a hand counts without another sign of life [ms], where its release may be lost: on X11, a hotkey or a
// keyboard grab (screen lock, password prompt, launcher) takes the key-up, and the window keeps its focus.
const FIRST_REPEAT = 3000; // from a key to its first repeat: desktops allow a delay of 2 s
const REPEAT = 500; // and two intervals, from one repeat to the next
const OTHER_KEY = 10_000; // after another key, because only the last key repeats
const STILL = 5000; // of a gamepad, which keeps its last state when its radio link is lost

/**
 * Listen to everything that holds or releases.
 *
 * @param {HTMLElement} button
 * @param {(event: object) => void} feed takes the events of hold.js
 * @param {() => boolean} isHeld
 * @param {() => void} turnOn called when a key is pressed while another hand holds
 * @returns {() => void} polls the gamepads, which have no events for their triggers
 */
export function listen(button, feed, isHeld, turnOn) {
  listenToPointers(button, feed, isHeld);
  listenToKeys(button, feed, isHeld, turnOn);
  listenToPage(button, feed, isHeld);
  return gamepads(feed);
}

function listenToPointers(button, feed, isHeld) {
  const hand = (event) => `pointer ${event.pointerId}`;
  const up = (event) => feed({ type: "up", hand: hand(event) });

  button.addEventListener("pointerdown", (event) => {
    if (event.button !== 0) return;
    button.setPointerCapture(event.pointerId);
    feed({ type: "down", hand: hand(event) });
  });
  for (const type of ["pointerup", "lostpointercapture"]) button.addEventListener(type, up);
  button.addEventListener("pointercancel", (event) =>
    feed({ type: "up", hand: hand(event), why: "the browser took the pointer for a gesture of its own" }),
  );
  // A press on a selection, as after Ctrl+A, must not become a drag of it.
  button.addEventListener("dragstart", (event) => event.preventDefault());
  button.addEventListener("pointermove", (event) => {
    if (!(event.buttons & 1)) up(event); // its pointerup was lost: a mouse moves, or a pen hovers
    else if (isBeside(button, event)) feed({ type: "up", hand: hand(event), why: "the hand slid off the button" });
  });
  button.addEventListener("pointerenter", (event) => {
    if (event.buttons & 1 && !isHeld()) feed({ type: "hint", why: "A drag holds nothing: press on the button itself" });
  });
  // Keeps a long touch from becoming a gesture: selection, context menu, scrolling.
  button.addEventListener("touchstart", (event) => event.preventDefault(), { passive: false });
}

function isBeside(button, { clientX, clientY }) {
  const { left, right, top, bottom } = button.getBoundingClientRect();
  return clientX < left - SLIP || clientX > right + SLIP || clientY < top - SLIP || clientY > bottom + SLIP;
}

function listenToKeys(button, feed, isHeld, turnOn) {
  const down = new Map(); // keys that pressed, as long as they are down, with the time of their last event
  const hand = (event) => `key ${event.code}`;
  const lack = "the key does not repeat any more";

  button.addEventListener("keydown", (event) => {
    if (event.key !== " " && event.key !== "Enter") return;
    event.preventDefault();
    if (event.repeat || event.ctrlKey || event.altKey || event.metaKey) return;
    if (isHeld() && !down.has(event.code)) {
      turnOn();
      return;
    }
    down.set(event.code, event.timeStamp);
    feed({ type: "down", hand: hand(event), lasts: FIRST_REPEAT, lack });
  });
  // At the window, because focus may move on while the key is down: hold Space, Tab to "Turn on", Enter.
  window.addEventListener(
    "keydown",
    (event) => {
      if (THIEVES.has(event.key)) feed({ type: "lost", why: "another key took over the keyboard" });
      if (event.repeat) repeat(event);
      else if (!down.has(event.code)) others();
      else if (event.target !== button) lose(event);
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

  function repeat(event) {
    if (!down.has(event.code)) return;
    const interval = event.timeStamp - down.get(event.code);
    down.set(event.code, event.timeStamp);
    feed({ type: "sign", hand: hand(event), lasts: REPEAT + 2 * interval, lack });
    if (event.target !== button) swallow(event);
  }

  function others() {
    for (const code of down.keys()) feed({ type: "sign", hand: `key ${code}`, lasts: OTHER_KEY, lack });
  }

  function lose(event) {
    down.delete(event.code);
    feed({ type: "up", hand: hand(event), why: "the key was let go unnoticed" });
  }
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
  const pads = new Map(); // by index
  const hand = (index) => `gamepad ${index}`;
  const lasting = { lasts: STILL, lack: `the gamepad has not moved for ${STILL / 1000} s` };

  // A trigger that is found pressed has to be let go first.
  window.addEventListener("gamepadconnected", ({ gamepad }) => {
    pads.set(gamepad.index, { isDown: true, shown: "" });
    if (gamepad.mapping === "standard") return;
    feed({ type: "hint", why: "The browser does not know the buttons of this gamepad: use mouse, finger or key" });
  });
  window.addEventListener("gamepaddisconnected", ({ gamepad }) => {
    pads.delete(gamepad.index);
    feed({ type: "up", hand: hand(gamepad.index), why: "the gamepad was disconnected" });
  });

  return () => {
    if (!pads.size) return;
    const found = navigator.getGamepads();
    for (const [index, before] of pads) {
      const shown = values(found[index]);
      const isDown = way(found[index]) > (before.isDown ? RELEASED : PRESSED);
      pads.set(index, { isDown, shown });
      if (isDown && !before.isDown && document.hasFocus()) feed({ type: "down", hand: hand(index), ...lasting });
      else if (isDown && shown !== before.shown) feed({ type: "sign", hand: hand(index), ...lasting });
      if (!isDown && before.isDown) feed({ type: "up", hand: hand(index) });
    }
  };
}

/** How far a trigger of a gamepad is pressed; 0 for a gamepad that is gone or has none. */
function way(pad) {
  if (!pad?.connected || pad.mapping !== "standard") return 0;
  return Math.max(...TRIGGERS.map((index) => pad.buttons[index]?.value ?? 0));
}

/** All that a gamepad says: a hand that holds it is never quite still. */
function values(pad) {
  return pad ? [pad.timestamp, ...pad.axes, ...pad.buttons.map((button) => button.value)].join() : "";
}
