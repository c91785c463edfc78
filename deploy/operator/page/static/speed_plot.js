/** The effector's speed over the last minute. */

import { byId, setText } from "./dom.js";
import { number } from "./format.js";
import { SPAN } from "./model.js";
import { niceStep } from "./scale.js";
import { Sheet, drawTimeAxis, frameOf, stroke } from "./sheet.js";

const USUAL = 0.9; // of the samples of a moving arm lie within the usual speeds: spikes are rare
const STILL = 0.01; // m/s; slower is no movement
const UNHEARD = 0.3; // s without a sample: the speed of the time between is not known
const HEADROOM = 1.5; // times the usual speed fits into the plot

/** The speed [m/s] that a moving arm seldom exceeds. */
export function usualSpeed(speeds) {
  const moving = speeds.filter((speed) => speed > STILL).sort();
  return moving[Math.floor(moving.length * USUAL)] ?? 0;
}

export class SpeedPlot {
  constructor() {
    this._sheet = new Sheet("speed-plot");
    this._top = 1; // m/s at the upper edge
  }

  render({ trace, time, speed, present }, isLive) {
    if (!Number.isFinite(time)) return;
    const begin = trace.from(time - SPAN);
    const speeds = new Float64Array(trace.length - begin);
    for (let row = begin; row < trace.length; row += 1) speeds[row - begin] = trace.at(row, 3) || 0;
    const highest = speeds.reduce((most, each) => Math.max(most, each), 0);
    this._choose(usualSpeed(speeds), highest);
    const above = highest > this._top ? ", above this plot" : "";
    setText(
      byId("speed-summary"),
      speeds.length ? `${present} ${number(isLive ? speed : null)} m/s, highest ${number(highest)} m/s${above}` : "no data yet",
    );
    const context = this._sheet.open();
    if (!context) return;
    const frame = frameOf(this._sheet);
    this._drawScale(context, frame);
    drawTimeAxis(context, this._sheet, frame, present);
    this._drawCurve(context, frame, trace, begin, time);
  }

  /** Choose the upper edge: a round number, kept for as long as it fits. A jump of the arm may lie above it. */
  _choose(usual, highest) {
    const needed = Math.min(highest, usual * HEADROOM);
    if (needed <= this._top && needed > this._top * 0.5) return;
    const step = niceStep(Math.max(needed, 0.1) / 2);
    this._top = Math.ceil((needed * 1.05) / step) * step || 1;
  }

  _drawScale(context, { left, right, top, bottom }) {
    const { colours } = this._sheet;
    const step = niceStep(this._top / 2);
    context.textAlign = "right";
    context.textBaseline = "middle";
    context.lineWidth = 1;
    for (let value = 0; value <= this._top * 1.001; value += step) {
      const y = Math.round(bottom - (value / this._top) * (bottom - top)) + 0.5;
      context.strokeStyle = colours.line;
      stroke(context, left, y, right, y);
      context.fillStyle = colours.muted;
      const unit = value + step > this._top * 1.001 ? " m/s" : "";
      context.fillText(number(value, step < 1 ? 1 : 0) + unit, left - 6, y);
    }
  }

  _drawCurve(context, { left, right, top, bottom }, trace, begin, time) {
    const x = (at) => right - ((time - at) / SPAN) * (right - left);
    const y = (value) => bottom - Math.min(1, value / this._top) * (bottom - top);
    const { accent } = this._sheet.colours;
    const pieces = [];
    let piece = null;
    let last = -Infinity;
    for (let row = begin; row < trace.length; row += 1) {
      const at = trace.at(row, 0);
      const value = trace.at(row, 3);
      if (Number.isNaN(value) || at - last > UNHEARD) piece = null;
      last = at;
      if (Number.isNaN(value)) continue;
      if (!piece) pieces.push((piece = []));
      piece.push(x(at), y(value));
    }
    context.strokeStyle = accent;
    context.lineWidth = this._sheet.unit * 0.11;
    context.lineJoin = "round";
    context.fillStyle = accent;
    for (const points of pieces) {
      context.beginPath();
      for (let index = 0; index < points.length; index += 2) context.lineTo(points[index], points[index + 1]);
      context.stroke();
      context.lineTo(points.at(-2), bottom);
      context.lineTo(points[0], bottom);
      context.globalAlpha = 0.14;
      context.fill();
      context.globalAlpha = 1;
    }
  }
}
