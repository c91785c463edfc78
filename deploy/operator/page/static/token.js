/**
 * The token of this start: it comes in the fragment of the printed address and lives as long as the tab.
 *
 * Where the browser stores nothing, it stays in the address.
 */

const KEY = "reactive-arm token";

/**
 * Take the token out of the address bar.
 *
 * @returns {string} the token of the address or, after a reload, the one kept in the tab; "" without any.
 */
export function takeToken() {
  const token = location.hash.slice(1);
  // The skip link also sets the fragment: an id of the page is no token.
  const given = token && !document.getElementById(token) ? token : "";
  try {
    if (given) {
      sessionStorage.setItem(KEY, given);
      history.replaceState(null, "", location.pathname + location.search);
    }
    return sessionStorage.getItem(KEY) ?? "";
  } catch (error) {
    if (!(error instanceof DOMException)) throw error;
    return given;
  }
}
