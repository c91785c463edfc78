/** Numbers and times as text. */

export const UNKNOWN = "–";

/** A number with a fixed count of digits and a true minus sign. */
export function number(value, digits = 2) {
  if (value === null || value === undefined || !Number.isFinite(value)) return UNKNOWN;
  const text = value.toFixed(digits);
  return Number(text) === 0 ? (0).toFixed(digits) : text.replace("-", "−");
}

/** The count of digits that shows a hundredth of a length, at least two. */
export const digitsOf = (length) => (length > 0 ? Math.max(2, 2 - Math.ceil(Math.log10(length))) : 2);

/** An angle [rad] in degrees. */
export const degrees = (angle) => (Number.isFinite(angle) ? `${number((angle * 180) / Math.PI, 1)}°` : UNKNOWN);

/** A duration [s] in words that are read at a glance. */
export function duration(seconds) {
  if (!Number.isFinite(seconds)) return UNKNOWN;
  if (seconds < 10) return `${number(Math.max(0, seconds), 1)} s`;
  if (seconds < 60) return `${Math.floor(seconds)} s`;
  const minutes = Math.floor(seconds / 60);
  if (minutes < 60) return `${minutes} min ${Math.floor(seconds % 60)} s`;
  return `${Math.floor(minutes / 60)} h ${minutes % 60} min`;
}

/** A duration [s] without tenths. */
export const wholeSeconds = (seconds) => (seconds < 10 ? `${Math.max(0, Math.floor(seconds))} s` : duration(seconds));

/** A time since the scenario's origin [s], as minutes and seconds. */
export function clock(seconds) {
  if (!Number.isFinite(seconds)) return "";
  if (seconds < 0) return `starts in ${duration(-seconds)}`;
  const whole = Math.floor(seconds);
  const pad = (value) => String(value).padStart(2, "0");
  const hours = Math.floor(whole / 3600);
  return `${hours ? `${hours}:` : ""}${pad(Math.floor(whole / 60) % 60)}:${pad(whole % 60)}`;
}

/** A wall clock time of the day. */
export const timeOfDay = (date) =>
  [date.getHours(), date.getMinutes(), date.getSeconds()].map((part) => String(part).padStart(2, "0")).join(":");

/** A sentence: first letter large, a full stop at the end. */
export function sentence(words) {
  const text = words.trim();
  if (!text) return "";
  return text[0].toUpperCase() + text.slice(1) + (/[.!?]$/.test(text) ? "" : ".");
}
