/**
 * Hold-to-run as a pure state machine: events in, messages for the server out.
 *
 * Released is the default. Only the press of a hand, with fresh word from the server, holds. Everything unexpected
 * releases, and then the hand has to let go and press again. All times are in milliseconds.
 *
 * Events have `type`, `at` (monotonic time) and
 * - `update`: `nonce`, the newest one of the server;
 * - `down`, `up`: `hand`, which names the pointer, key or gamepad; `up` may have a `why`;
 * - `sign`: `hand`, which is still there. `down` and `sign` may have `lasts`: how long the hand counts without another
 *   sign, where its release may be lost; and `lack`: why it counts no more after that;
 * - `lost`: `why`, such as a window that lost focus;
 * - `tick`: `wall`, the time of the wall clock; every PERIOD;
 * - `refused`, `released`: `why`, by the server;
 * - `hint`: `why` something that looks like a hold is none;
 * - `disconnected`.
 */

export const PERIOD = 50;
/** Silence of the server, delay of a tick or jump of the wall clock that releases. */
export const GAP = 250;

/**
 * @typedef {object} State
 * @property {boolean} held whether this page claims that a hand holds
 * @property {string|null} hand the hand that holds
 * @property {number} until time until which this hand counts without another sign of life
 * @property {string} lack why it counts no more after that
 * @property {string|null} nonce the newest nonce
 * @property {number} heard time of the newest nonce
 * @property {number} ticked time of the last tick
 * @property {number|null} offset wall clock minus monotonic clock
 * @property {string} why why the hold ended, if not by the hand, or was refused
 */

/** @type {State} */
export const RELEASED = Object.freeze({
  held: false,
  hand: null,
  until: Infinity,
  lack: "",
  nonce: null,
  heard: -Infinity,
  ticked: -Infinity,
  offset: null,
  why: "",
});

/**
 * Return the state after an event, and the messages to send.
 *
 * @param {State} state
 * @param {object} event
 * @returns {{state: State, send: object[]}}
 */
export function step(state, event) {
  if (state.held && isLate(state, event.at)) {
    const late = release(state, "this page was too busy to beat in time");
    return { state: { ...step(late.state, event).state, why: late.state.why }, send: late.send };
  }
  switch (event.type) {
    case "update":
      return { state: noted(state, event), send: [] };
    case "down":
      return press(state, event);
    case "sign":
      return { state: state.held && state.hand === event.hand ? lively(state, event) : state, send: [] };
    case "up":
      if (!state.held || state.hand !== event.hand) return { state, send: [] };
      return release(state, event.why ?? "");
    case "lost":
      return state.held ? release(state, event.why) : { state, send: [] };
    case "tick":
      return tick(state, event);
    case "refused":
      return { state: { ...state, held: false, hand: null, why: `Not held: ${event.why}` }, send: [] };
    case "released":
      return { state: state.held ? release(state, event.why).state : state, send: [] };
    case "hint":
      return { state: state.held ? state : { ...state, why: event.why }, send: [] };
    case "disconnected":
      return disconnect(state);
    default:
      throw new TypeError(`unknown event ${event.type}`);
  }
}

function press(state, event) {
  if (state.held && state.hand === event.hand) return release(state, "it was let go unnoticed, and pressed again");
  if (state.held) return { state, send: [] }; // a second hand changes nothing
  if (isLate(state, event.at) || !isFresh(state, event.at)) {
    return { state: { ...state, why: "Not held: no fresh word from the server. Press again" }, send: [] };
  }
  return {
    state: lively({ ...state, held: true, hand: event.hand, why: "" }, event),
    send: [{ type: "press", nonce: state.nonce }],
  };
}

function tick(state, event) {
  const now = noted(state, event);
  if (!state.held) return { state: now, send: [] };
  // The monotonic clock may stand still while a machine sleeps; the wall clock does not.
  if (now.offset - state.offset > GAP) return release(now, "this device slept");
  if (event.at > state.until) return release(now, state.lack);
  if (!isFresh(state, event.at)) return release(now, "no word from the server in time");
  return { state: now, send: [{ type: "beat", nonce: state.nonce }] };
}

function disconnect(state) {
  const silent = { ...state, nonce: null, heard: -Infinity };
  return state.held ? release(silent, "the connection was lost") : { state: silent, send: [] };
}

/** Release; a hand that lets go needs no reason. */
function release(state, why) {
  const words = why && `Released: ${why}`;
  return { state: { ...state, held: false, hand: null, why: words }, send: [{ type: "release" }] };
}

/** The state with a hand that has just given a sign of life. */
function lively(state, { at, lasts = Infinity, lack = "" }) {
  return { ...state, until: at + lasts, lack };
}

/** The state with what an event says about nonces and clocks. */
function noted(state, event) {
  if (event.type === "update") return { ...state, nonce: event.nonce, heard: event.at };
  if (event.type === "tick") return { ...state, ticked: event.at, offset: event.wall - event.at };
  return state;
}

const isLate = (state, at) => at - state.ticked > PERIOD + GAP;
const isFresh = (state, at) => state.nonce !== null && at - state.heard <= GAP;
