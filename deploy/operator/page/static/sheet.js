/** A canvas for a plot of the last minute, and its time axis. */

import { byId } from "./dom.js";
import { SPAN } from "./model.js";

const TICKS = [60, 50, 40, 30, 20, 10, 0]; // s ago
const LABELS = 4.1; // rem, width of the labels on the left
const COLOURS = ["ink", "muted", "line", "accent", "good", "warn", "bad", "on-solid", "card"];

const dark = matchMedia("(prefers-color-scheme: dark)");

/** A canvas that keeps its sharpness, knows whether it is on the screen, and has the page's colours. */
export class Sheet {
  constructor(id) {
    this._canvas = byId(id);
    this._context = this._canvas.getContext("2d");
    this._isVisible = true;
    this._isDirty = true;
    new ResizeObserver(() => this._measure()).observe(this._canvas);
    new IntersectionObserver(([entry]) => {
      this._isVisible = entry.isIntersecting;
      this._isDirty = true;
    }).observe(this._canvas);
    dark.addEventListener("change", () => this._measure());
    this._measure();
  }

  /** The context, cleared, in CSS pixels; null when there is nothing to draw on. */
  open() {
    if (!this._isVisible || !this.width) return null;
    const { width, height } = this._canvas;
    if (this._isDirty) {
      this._canvas.width = Math.round(this.width * this._ratio);
      this._canvas.height = Math.round(this.height * this._ratio);
      this._isDirty = false;
    } else {
      this._context.setTransform(1, 0, 0, 1, 0, 0);
      this._context.clearRect(0, 0, width, height);
    }
    this._context.setTransform(this._ratio, 0, 0, this._ratio, 0, 0);
    this._context.font = `${this.unit * 0.75}px ${this.font}`;
    return this._context;
  }

  _measure() {
    const style = getComputedStyle(this._canvas);
    const { width, height } = this._canvas.getBoundingClientRect(); // fractions count: they keep lines sharp
    this.width = width;
    this.height = height;
    this._ratio = Math.min(window.devicePixelRatio || 1, 3);
    this.unit = parseFloat(getComputedStyle(document.documentElement).fontSize);
    this.font = style.fontFamily;
    this.colours = Object.fromEntries(COLOURS.map((name) => [name, style.getPropertyValue(`--${name}`).trim()]));
    this._isDirty = true;
  }
}

/** Where a plot has its data: the same for all, so that their times lie below each other. */
export function frameOf(sheet) {
  return {
    left: sheet.unit * LABELS,
    right: sheet.width - 6,
    top: sheet.unit * 0.6,
    bottom: sheet.height - sheet.unit * 1.5,
  };
}

export function drawTimeAxis(context, sheet, { left, right, top, bottom }, present) {
  const { colours, unit } = sheet;
  context.textBaseline = "top";
  context.lineWidth = 1;
  const isNarrow = right - left < unit * 18;
  for (const ago of TICKS) {
    const x = Math.round(right - (ago / SPAN) * (right - left)) + 0.5;
    context.strokeStyle = colours.line;
    stroke(context, x, top, x, bottom + 3);
    if (isNarrow && ago % 20) continue;
    context.textAlign = ago === 0 ? "right" : "center";
    context.fillStyle = colours.muted;
    context.fillText(ago === 0 ? present : `−${ago} s`, x, bottom + unit * 0.45);
  }
}

export function stroke(context, x1, y1, x2, y2) {
  context.beginPath();
  context.moveTo(x1, y1);
  context.lineTo(x2, y2);
  context.stroke();
}
