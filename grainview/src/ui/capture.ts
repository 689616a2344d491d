// Pictures (PNG), image sequences (zip) and movies (WebM) of the canvas, and their download.

import { zipSync } from "fflate";
import { DARK, LIGHT, type World } from "../scene/world";

export interface ImageOptions {
  width: number;
  height: number;
  transparent: boolean;
  dark: boolean;
  write: ((pen: CanvasRenderingContext2D) => void) | null; // draws the caption while the stage has this size
}

/** Maximum width and height of a picture [pixels]. */
export const MAX_SIZE = 8192;

/** Render a PNG of the given size, with twofold supersampling where the graphics card allows it. */
export async function renderPng(world: World, options: ImageOptions): Promise<Blob> {
  const { stage } = world;
  const { renderer } = stage;
  const before = { ratio: renderer.getPixelRatio(), width: stage.width, height: stage.height };
  const limit = Math.min(renderer.capabilities.maxTextureSize, MAX_SIZE);
  const supersampling = 2 * Math.max(options.width, options.height) <= limit ? 2 : 1;
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [options.width, options.height];
  try {
    renderer.setPixelRatio(supersampling);
    renderer.setSize(options.width, options.height, false);
    [stage.width, stage.height] = [options.width, options.height];
    world.setTheme(options.dark ? DARK : LIGHT, options.transparent);
    stage.draw();
    const pen = canvas.getContext("2d");
    if (!pen) throw new Error("the browser has no canvas for a picture of this size; choose a smaller one");
    pen.imageSmoothingQuality = "high";
    pen.drawImage(stage.canvas, 0, 0, options.width, options.height);
    options.write?.(pen);
  } finally {
    renderer.setPixelRatio(before.ratio);
    world.setTheme(options.dark ? DARK : LIGHT);
    stage.resize(before.width, before.height);
    stage.draw();
  }
  return new Promise((resolve, reject) => {
    const done = (blob: Blob | null): void =>
      blob ? resolve(blob) : reject(new Error("this picture is too large for the browser"));
    canvas.toBlob(done, "image/png");
  });
}

export function download(blob: Blob, name: string): void {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 30_000);
}

/** A zip of pictures named frame-000000.png and so on; frames for which `draw` returns null are left out. */
export async function imageSequence(frames: number[], draw: (frame: number) => Promise<Blob | null>): Promise<Blob> {
  const files: Record<string, Uint8Array> = {};
  for (const frame of frames) {
    const image = await draw(frame);
    if (!image) continue;
    files[`frame-${String(frame).padStart(6, "0")}.png`] = new Uint8Array(await image.arrayBuffer());
  }
  return new Blob([zipSync(files, { level: 0 }) as Uint8Array<ArrayBuffer>], { type: "application/zip" });
}

const pause = (milliseconds: number): Promise<void> => new Promise((resolve) => setTimeout(resolve, milliseconds));

const FORMATS = ["video/webm;codecs=vp9", "video/webm;codecs=vp8", "video/webm"];

/** Whether this browser can record a movie. */
export function canRecord(): boolean {
  return typeof MediaRecorder !== "undefined" && FORMATS.some((format) => MediaRecorder.isTypeSupported(format));
}

/** Record a WebM movie of a canvas; `draw` draws a frame on it, or returns false to leave the frame out. */
export async function recordMovie(
  canvas: HTMLCanvasElement,
  frames: number[],
  framesPerSecond: number,
  draw: (frame: number) => Promise<boolean>,
): Promise<Blob> {
  const stream = canvas.captureStream(0);
  const track = stream.getVideoTracks()[0] as CanvasCaptureMediaStreamTrack;
  const format = FORMATS.find((f) => MediaRecorder.isTypeSupported(f));
  const recorder = new MediaRecorder(stream, { mimeType: format, videoBitsPerSecond: 12e6 });
  const parts: Blob[] = [];
  recorder.ondataavailable = (event) => parts.push(event.data);
  const stopped = new Promise<void>((resolve) => (recorder.onstop = () => resolve()));
  recorder.start();
  for (const frame of frames) {
    const start = performance.now();
    if (!(await draw(frame))) continue;
    track.requestFrame();
    await pause(Math.max(1000 / framesPerSecond - (performance.now() - start), 0));
  }
  track.requestFrame(); // the last one again: a recorder that is stopped too early loses it
  await pause(300);
  recorder.stop();
  await stopped;
  track.stop();
  return new Blob(parts, { type: "video/webm" });
}
