// What is written on pictures and movies that are saved: the time, what the colours mean, a bar of length.

import type { Bar, KeyPart } from "../data/key";
import type { Theme } from "../scene/world";
import type { LengthBar } from "./overlay";

export interface Caption {
  time: string;
  key: KeyPart[];
  bar: LengthBar;
  theme: Theme;
  halo: boolean; // around letters, so that they are read before grains, too
}

type Pen = CanvasRenderingContext2D;

/** Pixels of a picture in which letters are as high as on the page, and the least letters can be read with. */
const [WIDE, HIGH, LETTERS, LEAST] = [800, 500, 12, 9];

/** How much larger than on the page letters and bars are in a picture of this size. */
export function growth(width: number, height: number): number {
  return Math.max(Math.min(width / WIDE, height / HIGH), LEAST / LETTERS);
}

/** One line of text, its middle at a height. */
function write(pen: Pen, text: string, x: number, y: number, one: number, { theme, halo }: Caption): void {
  pen.lineWidth = 3 * one;
  pen.lineJoin = "round";
  pen.strokeStyle = theme.background;
  if (halo) pen.strokeText(text, x, y);
  pen.fillStyle = theme.ink;
  pen.fillText(text, x, y);
}

function font(pen: Pen, one: number, bold = false): void {
  pen.font = `${bold ? "600 " : ""}${LETTERS * one}px system-ui, -apple-system, "Segoe UI", Roboto, sans-serif`;
  pen.textBaseline = "middle";
}

/** A bar of colours in a row, numbers at its ends and middle under it; how high both are. */
function drawBar(pen: Pen, x: number, y: number, one: number, part: Bar, all: Caption): number {
  const wide = 200 * one;
  const shades = pen.createLinearGradient(x, 0, x + wide, 0);
  part.bar.forEach((colour, i) => shades.addColorStop(i / Math.max(part.bar.length - 1, 1), colour));
  pen.fillStyle = shades;
  pen.fillRect(x, y, wide, 10 * one);
  part.numbers.forEach((text, i) => {
    pen.textAlign = (["left", "center", "right"] as const)[i];
    write(pen, text, x + (i / 2) * wide, y + 20 * one, one, all);
  });
  pen.textAlign = "left";
  return 30 * one;
}

/** The time and the key, from the upper left down. */
function drawKey(pen: Pen, one: number, all: Caption): void {
  const x = 14 * one;
  let y = 20 * one;
  pen.textAlign = "left";
  font(pen, one, true);
  write(pen, all.time, x, y, one, all);
  y += 26 * one;
  for (const part of all.key) {
    font(pen, one, true);
    write(pen, part.title, x, y, one, all);
    font(pen, one);
    y += 14 * one;
    if ("bar" in part) {
      y += drawBar(pen, x, y, one, part, all);
    } else {
      for (const { colour, text } of part.rows) {
        if (colour !== null) {
          pen.fillStyle = colour;
          pen.beginPath();
          pen.arc(x + 5.5 * one, y + 5 * one, 5.5 * one, 0, 2 * Math.PI);
          pen.fill();
        }
        write(pen, text, x + (colour === null ? 0 : 17 * one), y + 5 * one, one, all);
        y += 20 * one;
      }
    }
    y += 14 * one;
  }
}

function drawLength(pen: Pen, one: number, all: Caption): void {
  const { width, height } = pen.canvas;
  const [right, low] = [width - 18 * one, height - 18 * one];
  const left = right - all.bar.pixels;
  pen.strokeStyle = all.theme.ink;
  pen.lineWidth = 1.6 * one;
  pen.lineJoin = "miter";
  pen.beginPath();
  pen.moveTo(left, low - 4 * one);
  pen.lineTo(left, low);
  pen.lineTo(right, low);
  pen.lineTo(right, low - 4 * one);
  pen.stroke();
  font(pen, one);
  pen.textAlign = "right";
  write(pen, all.bar.text, right, low - 12 * one, one, all);
}

/** Write on a picture. */
export function writeCaption(pen: Pen, all: Caption): void {
  const one = growth(pen.canvas.width, pen.canvas.height);
  drawKey(pen, one, all);
  drawLength(pen, one, all);
}
