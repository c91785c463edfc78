/** The token of this start: it comes in the fragment of the printed address and lives as long as the tab. */

const KEY = "reactive-arm token";

/**
 * Take the token out of the address bar.
 *
 * @returns {string} the token of the address or, after a reload, the one kept in the tab; "" without any.
 */
export function takeToken() {
  const token = location.hash.slice(1);
  // The skip link also sets the fragment: an id of the page is no token.
  if (token && !document.getElementById(token)) {
    sessionStorage.setItem(KEY, token);
    history.replaceState(null, "", location.pathname + location.search);
  }
  return sessionStorage.getItem(KEY) ?? "";
}
