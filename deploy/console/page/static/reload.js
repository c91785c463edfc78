/** Loads the page again if a part of it did not arrive, as after a change of the network: without it, nothing would. */

const RETRY = 1000; // ms

/** Wait until the server answers: the browser would show an error instead of a page that it cannot load. */
async function reload() {
  try {
    await fetch(location.pathname);
    location.reload();
  } catch {
    setTimeout(reload, RETRY);
  }
}

// A failed part raises an error without a bubble, also for what it imports itself.
addEventListener("error", ({ target }) => target instanceof Element && setTimeout(reload, RETRY), { capture: true });
