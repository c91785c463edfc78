/** Round numbers for scales. */

/** The largest of 1, 2, 5, 10, ... (and their tenths) that is not above a value. */
export function niceStep(value) {
  const power = 10 ** Math.floor(Math.log10(value));
  const factor = value / power;
  return power * (factor >= 5 ? 5 : factor >= 2 ? 2 : 1);
}
