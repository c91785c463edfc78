/** Loads the page again if a part of it did not arrive, for example because the network changed meanwhile. */

const RETRY = 1000; // ms

/** Reload as soon as the server answers: before that, the browser would replace the page with an error of its own. */
async function reload() {
  try {
    await fetch(location.pathname);
    location.reload();
  } catch {
    setTimeout(reload, RETRY);
  }
}

// These errors do not bubble. A script also has one if something that it imports does not arrive.
addEventListener("error", ({ target }) => target instanceof Element && setTimeout(reload, RETRY), { capture: true });
