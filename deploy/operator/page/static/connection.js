/** The socket to the server: opens itself again, and knows when its news are old. */

const STALE = 350; // ms without an update until the page greys out
const DEAD = 2000; // ms without an update, or without a welcome, until a new socket is tried
const DELAYS = [250, 500, 1000, 2000]; // ms until the next attempt
const MOST_UNSENT = 4096; // bytes; more wait only where the link stands still

/** Close codes after which another attempt is of no use. */
const FINAL = {
  4401: "This page has no token of the present start. Open the address that the terminal shows now.",
  4403: "The server does not accept this address. Open the address that the terminal shows.",
};
/** Too much of something at a time, such as pages: another attempt may succeed. */
const FULL = 4429;
const NO_TOKEN = "This address has no token. Open the address that the terminal shows.";

export class Connection {
  /**
   * @param {object} listener `welcome`, `update`, `refused`, `released` take a message; `changed` is called at each
   *   change of the state
   */
  constructor(listener) {
    this._listener = listener;
    this._socket = null;
    this._token = "";
    /** Attempts that failed since the last update. */
    this.failures = 0;
    /** Why the server did not admit this page at the last attempt. */
    this.refused = "";
    this._retry = 0;
    this._opened = 0;
    this._heard = -Infinity;
    /** `connecting`, `live`, `lost` or `closed`. */
    this.state = "connecting";
    /** Why the connection is closed for good. */
    this.why = "";
    /** Wall clock time since when no update came. */
    this.since = new Date();
  }

  /** Connect, now and again after each loss, with this token. */
  open(token) {
    this.close();
    this._token = token;
    this.failures = 0;
    if (!token) {
      this._become("closed", NO_TOKEN);
      return;
    }
    if (this.state === "closed") this._become("connecting");
    this._connect();
  }

  /** End the connection; `open` begins a new one. */
  close() {
    clearTimeout(this._retry);
    const socket = this._socket;
    this._socket = null;
    socket?.close();
    if (this.state === "live") this._become("lost");
  }

  /** Connect at once if an attempt is due later. */
  hurry() {
    if (!this._socket && this.state !== "closed" && this._token) {
      clearTimeout(this._retry);
      this._connect();
    }
  }

  /**
   * Send a message, if the link takes it.
   *
   * @returns {boolean} whether it was sent
   */
  send(message) {
    if (this._socket?.readyState !== WebSocket.OPEN || this._socket.bufferedAmount > MOST_UNSENT) return false;
    this._socket.send(JSON.stringify(message));
    return true;
  }

  /** Judge how old the news are; called often. */
  tick(now) {
    if (this.state === "live" && now - this._heard > STALE) this._become("lost");
    if (this._socket && now - Math.max(this._heard, this._opened) > DEAD) this._lose();
  }

  _connect() {
    const address = new URL("socket", location.href); // relative: the page may lie under a path of a proxy
    address.protocol = location.protocol === "https:" ? "wss:" : "ws:";
    address.hash = "";
    const socket = new WebSocket(address);
    this._socket = socket;
    this._opened = performance.now();
    socket.onopen = () => socket === this._socket && this.send({ type: "hello", token: this._token });
    socket.onmessage = (event) => socket === this._socket && this._receive(JSON.parse(event.data));
    socket.onclose = (event) => {
      if (socket !== this._socket) return;
      this.refused = event.code === FULL ? event.reason : "";
      this._lose(FINAL[event.code]);
    };
  }

  _receive(message) {
    if (message.type === "update") {
      this._heard = performance.now();
      this.since = new Date();
      this.failures = 0;
      this.refused = "";
      if (this.state !== "live") this._become("live");
    }
    this._listener[message.type]?.(message);
  }

  _lose(final) {
    const socket = this._socket;
    this._socket = null;
    socket.close();
    if (final) {
      this._become("closed", final);
      return;
    }
    const delay = DELAYS[Math.min(this.failures, DELAYS.length - 1)];
    this.failures += 1;
    this._retry = setTimeout(() => this._connect(), delay);
    this._become(this.state === "connecting" ? "connecting" : "lost");
  }

  _become(state, why = "") {
    this.state = state;
    this.why = why;
    this._listener.changed();
  }
}
