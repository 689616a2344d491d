// The caption of saved pictures and movies: time, legend and scale bar.

import { FIELD, MOMENT } from "../data/glance";
import type { Bar, KeyPart, Shares, Swatch } from "../data/key";
import { armsOf, type DirectedView, type Directions } from "../scene/directions";
import type { Theme } from "../scene/world";
import type { LengthBar } from "./overlay";

export interface Caption {
  time: string;
  key: KeyPart[];
  bar: LengthBar;
  theme: Theme;
  glance?: Shares[]; // what is told of the frame as a whole, at the upper right
  directions?: Directions; // axes, field and net moment, at the lower left
  halo: boolean; // outline around letters, so that they can be read in front of grains
}

type Pen = CanvasRenderingContext2D;

/** Width and height of a picture [pixels] at which the font has its size on the page, that size, and the minimum. */
const [WIDTH, HEIGHT, FONT_SIZE, MIN_FONT_SIZE] = [800, 500, 12, 9];

/** Scale of letters and bars in a picture of this size, relative to the page. */
export function captionScale(width: number, height: number): number {
  return Math.max(Math.min(width / WIDTH, height / HEIGHT), MIN_FONT_SIZE / FONT_SIZE);
}

/** One line of text, vertically centred at y. */
function write(pen: Pen, text: string, x: number, y: number, scale: number, { theme, halo }: Caption): void {
  pen.lineWidth = 3 * scale;
  pen.lineJoin = "round";
  pen.strokeStyle = theme.background;
  if (halo) pen.strokeText(text, x, y);
  pen.fillStyle = theme.ink;
  pen.fillText(text, x, y);
}

function font(pen: Pen, scale: number, bold = false): void {
  pen.font = `${bold ? "600 " : ""}${FONT_SIZE * scale}px system-ui, -apple-system, "Segoe UI", Roboto, sans-serif`;
  pen.textBaseline = "middle";
}

/** A colour bar with numbers below its ends and its middle; returns the height of both. */
function drawBar(pen: Pen, x: number, y: number, scale: number, part: Bar, caption: Caption): number {
  const width = 200 * scale;
  const gradient = pen.createLinearGradient(x, 0, x + width, 0);
  part.bar.forEach((colour, i) => gradient.addColorStop(i / Math.max(part.bar.length - 1, 1), colour));
  pen.fillStyle = gradient;
  pen.fillRect(x, y, width, 10 * scale);
  part.numbers.forEach((text, i) => {
    pen.textAlign = (["left", "center", "right"] as const)[i];
    write(pen, text, x + (i / 2) * width, y + 20 * scale, scale, caption);
  });
  pen.textAlign = "left";
  return 30 * scale;
}

/** Rows with dots, downwards from y; returns their height. */
function drawRows(pen: Pen, x: number, y: number, scale: number, rows: Swatch[], caption: Caption): number {
  rows.forEach(({ colour, text }, k) => {
    const middle = y + (5 + 20 * k) * scale;
    if (colour !== null) {
      pen.fillStyle = colour;
      pen.beginPath();
      pen.arc(x + 5.5 * scale, middle, 5.5 * scale, 0, 2 * Math.PI);
      pen.fill();
    }
    write(pen, text, x + (colour === null ? 0 : 17 * scale), middle, scale, caption);
  });
  return 20 * rows.length * scale;
}

/** A bar of shares; returns its height. */
function drawShares(pen: Pen, x: number, y: number, scale: number, { shares }: Shares, theme: Theme): number {
  if (!shares.length) return 0;
  pen.fillStyle = theme.line;
  pen.globalAlpha = 0.3;
  pen.fillRect(x, y - 4 * scale, 200 * scale, 10 * scale);
  pen.globalAlpha = 1;
  let left = x;
  for (const { colour, share } of shares) {
    pen.fillStyle = colour;
    pen.fillRect(left, y - 4 * scale, 200 * scale * share, 10 * scale);
    left += 200 * scale * share;
  }
  return 14 * scale;
}

/** Parts of a legend, downwards from a point. */
function drawParts(pen: Pen, x: number, y: number, scale: number, parts: (KeyPart | Shares)[], caption: Caption): void {
  for (const part of parts) {
    font(pen, scale, true);
    write(pen, part.title, x, y, scale, caption);
    font(pen, scale);
    y += 14 * scale;
    if ("bar" in part) y += drawBar(pen, x, y, scale, part, caption);
    else {
      if ("shares" in part) y += drawShares(pen, x, y, scale, part, caption.theme);
      y += drawRows(pen, x, y, scale, part.rows, caption);
    }
    y += 14 * scale;
  }
}

function drawDirections(pen: Pen, scale: number, caption: Caption, view: DirectedView): void {
  if (!caption.directions) return;
  const { theme } = caption;
  const colours = { "": theme.line, field: FIELD[Number(theme.dark)], moment: MOMENT[Number(theme.dark)] };
  pen.textAlign = "center";
  for (const { kind, name, from, to, label, head } of armsOf(view, caption.directions, scale)) {
    pen.strokeStyle = pen.fillStyle = colours[kind];
    pen.lineWidth = 1.6 * scale;
    pen.beginPath();
    pen.moveTo(...from);
    pen.lineTo(...to);
    pen.stroke();
    pen.beginPath();
    for (const corner of head) pen.lineTo(...corner);
    pen.fill();
    font(pen, 0.92 * scale, kind !== "");
    write(pen, name, ...label, scale, { ...caption, theme: { ...theme, ink: colours[kind] } });
  }
}

function drawScaleBar(pen: Pen, scale: number, caption: Caption): void {
  const { width, height } = pen.canvas;
  const [right, bottom] = [width - 18 * scale, height - 18 * scale];
  const left = right - caption.bar.pixels;
  pen.strokeStyle = caption.theme.ink;
  pen.lineWidth = 1.6 * scale;
  pen.lineJoin = "miter";
  pen.beginPath();
  pen.moveTo(left, bottom - 4 * scale);
  pen.lineTo(left, bottom);
  pen.lineTo(right, bottom);
  pen.lineTo(right, bottom - 4 * scale);
  pen.stroke();
  font(pen, scale);
  pen.textAlign = "right";
  write(pen, caption.bar.text, right, bottom - 12 * scale, scale, caption);
}

/** Draw the caption on a picture of a view. */
export function writeCaption(pen: Pen, caption: Caption, view: DirectedView): void {
  const scale = captionScale(pen.canvas.width, pen.canvas.height);
  const x = 14 * scale;
  pen.textAlign = "left";
  font(pen, scale, true);
  write(pen, caption.time, x, 20 * scale, scale, caption);
  drawParts(pen, x, 46 * scale, scale, caption.key, caption);
  drawParts(pen, pen.canvas.width - 214 * scale, 20 * scale, scale, caption.glance ?? [], caption);
  drawDirections(pen, scale, caption, view);
  drawScaleBar(pen, scale, caption);
}
