/** Hand, operator and engines over the last minute; shape and word show as much as colour. */

import { byId, setText } from "./dom.js";
import { SPAN } from "./model.js";
import { Sheet, drawTimeAxis, frameOf, stroke } from "./sheet.js";

/** How values look: `solid`, `hollow`, `striped` or `crossed`, with a colour and a word. */
const LOOKS = {
  released: { kind: "hollow", colour: "muted", word: "released" },
  this_page: { kind: "solid", colour: "good", word: "you" },
  other_page: { kind: "solid", colour: "accent", word: "another page" },
  terminal: { kind: "solid", colour: "accent", word: "terminal" },
  dead_mans_switch: { kind: "solid", colour: "accent", word: "scenario" },
  somewhere: { kind: "solid", colour: "accent", word: "held" },
  seen: { kind: "solid", colour: "good", word: "seen" },
  unseen: { kind: "hollow", colour: "muted", word: "not seen" },
  missed: { kind: "striped", colour: "warn", word: "missed" },
  incapacitated: { kind: "crossed", colour: "bad", word: "incapacitated" },
  on: { kind: "solid", colour: "good", word: "on" },
  off: { kind: "hollow", colour: "muted", word: "off" },
};

export class Timeline {
  constructor() {
    this._sheet = new Sheet("timeline-plot");
  }

  render({ hands, operators, strikes, engineStates, time, switch: hold, operator, engines, present }, isLive) {
    if (!Number.isFinite(time)) return;
    const words = [
      hold.held ? "Held" : "Released",
      operator.seen ? "operator seen" : "operator not seen",
      `engines ${engines.state ?? "not known"}`,
    ];
    setText(byId("timeline-summary"), isLive ? words.join(", ") : "not known now");
    const context = this._sheet.open();
    if (!context) return;
    const frame = frameOf(this._sheet);
    drawTimeAxis(context, this._sheet, frame, present);
    const rows = [
      ["Hand", hands.items],
      ["Operator", operators.items],
      ["Engines", engineStates.items],
    ];
    const height = (frame.bottom - frame.top) / rows.length;
    rows.forEach(([name, items], index) => {
      const middle = frame.top + height * (index + 0.5);
      context.fillStyle = this._sheet.colours.ink;
      context.textAlign = "right";
      context.textBaseline = "middle";
      context.fillText(name, frame.left - 8, middle);
      const thickness = Math.min(height * 0.6, this._sheet.unit * 1.6);
      this._drawRow(context, frame, items, time, middle, thickness);
      if (items === operators.items) this._drawStrikes(context, frame, strikes.items, time, middle - thickness / 2);
    });
  }

  /** Mark each strike by a number above its begin. */
  _drawStrikes(context, { left, right }, items, time, bottom) {
    const size = this._sheet.unit * 0.3;
    items.forEach(([at, count], index) => {
      const x = right - ((time - at) / SPAN) * (right - left);
      if (!(count > items[index - 1]?.[1]) || x < left) return;
      context.fillStyle = this._sheet.colours.bad;
      context.beginPath();
      context.moveTo(x, bottom);
      context.lineTo(x - size, bottom - size * 1.4);
      context.lineTo(x + size, bottom - size * 1.4);
      context.fill();
      context.textAlign = "center";
      context.textBaseline = "bottom";
      context.fillText(count, x, bottom - size * 1.5);
    });
  }

  _drawRow(context, { left, right }, items, time, middle, height) {
    const x = (at) => Math.max(left, right - ((time - at) / SPAN) * (right - left));
    items.forEach(([at, value], index) => {
      const end = items[index + 1]?.[0] ?? time;
      if (value === null || end < time - SPAN) return;
      const look = LOOKS[value] ?? { kind: "hollow", colour: "muted", word: value };
      const box = [x(at), middle - height / 2, Math.max(1, x(end) - x(at) - 1), height];
      drawBox(context, this._sheet.colours, look, box);
    });
  }
}

function drawBox(context, colours, { kind, colour, word }, [x, y, width, height]) {
  context.strokeStyle = context.fillStyle = colours[colour];
  context.lineWidth = 1;
  if (kind === "solid") context.fillRect(x, y, width, height);
  else if (kind === "hollow") stroke(context, x, y + height / 2, x + width, y + height / 2);
  else {
    context.save();
    context.beginPath();
    context.rect(x, y, width, height);
    context.clip();
    hatch(context, x, y, width, height, 1);
    if (kind === "crossed") hatch(context, x, y, width, height, -1);
    context.restore();
    context.strokeRect(x + 0.5, y + 0.5, Math.max(0, width - 1), height - 1);
  }
  const room = context.measureText(word).width + 10;
  if (room > width) return;
  context.textAlign = "center";
  context.textBaseline = "middle";
  if (kind !== "solid") {
    context.fillStyle = colours.card;
    context.fillRect(x + (width - room) / 2, y + height * 0.12, room, height * 0.76);
  }
  context.fillStyle = kind === "solid" ? colours["on-solid"] : colours[colour];
  context.fillText(word, x + width / 2, y + height / 2 + 0.5);
}

function hatch(context, x, y, width, height, direction) {
  context.beginPath();
  const step = 6;
  // Aligned with the canvas: stripes stand still while a box grows.
  for (let at = x - height - ((x - height) % step); at < x + width + height; at += step) {
    context.moveTo(at, y + (direction > 0 ? height : 0));
    context.lineTo(at + height, y + (direction > 0 ? 0 : height));
  }
  context.stroke();
}
