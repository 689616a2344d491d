// The caption of saved pictures and movies: time, legend and scale bar.

import type { Bar, KeyPart } from "../data/key";
import type { Theme } from "../scene/world";
import type { LengthBar } from "./overlay";

export interface Caption {
  time: string;
  key: KeyPart[];
  bar: LengthBar;
  theme: Theme;
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

/** Time and legend, downwards from the upper left corner. */
function drawKey(pen: Pen, scale: number, caption: Caption): void {
  const x = 14 * scale;
  let y = 20 * scale;
  pen.textAlign = "left";
  font(pen, scale, true);
  write(pen, caption.time, x, y, scale, caption);
  y += 26 * scale;
  for (const part of caption.key) {
    font(pen, scale, true);
    write(pen, part.title, x, y, scale, caption);
    font(pen, scale);
    y += 14 * scale;
    if ("bar" in part) {
      y += drawBar(pen, x, y, scale, part, caption);
    } else {
      for (const { colour, text } of part.rows) {
        if (colour !== null) {
          pen.fillStyle = colour;
          pen.beginPath();
          pen.arc(x + 5.5 * scale, y + 5 * scale, 5.5 * scale, 0, 2 * Math.PI);
          pen.fill();
        }
        write(pen, text, x + (colour === null ? 0 : 17 * scale), y + 5 * scale, scale, caption);
        y += 20 * scale;
      }
    }
    y += 14 * scale;
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

/** Draw the caption on a picture. */
export function writeCaption(pen: Pen, caption: Caption): void {
  const scale = captionScale(pen.canvas.width, pen.canvas.height);
  drawKey(pen, scale, caption);
  drawScaleBar(pen, scale, caption);
}
