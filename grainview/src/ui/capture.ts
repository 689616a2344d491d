// Pictures and movies of what is seen.

import { zipSync } from "fflate";
import { DARK, LIGHT, type World } from "../scene/world";

export interface Wish {
  width: number;
  height: number;
  transparent: boolean;
  dark: boolean;
  write: ((pen: CanvasRenderingContext2D) => void) | null; // on the picture, while the stage is of its size
}

/** Largest side of a picture. */
export const LARGEST = 8192;

/** The picture as a PNG of a chosen size; drawn twice as large and made smaller, so that edges are smooth. */
export async function picture(world: World, wish: Wish): Promise<Blob> {
  const { stage } = world;
  const { renderer } = stage;
  const before = { ratio: renderer.getPixelRatio(), width: stage.width, height: stage.height };
  const most = renderer.capabilities.maxTextureSize;
  const fine = 2 * Math.max(wish.width, wish.height) <= Math.min(most, LARGEST) ? 2 : 1;
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [wish.width, wish.height];
  try {
    renderer.setPixelRatio(fine);
    renderer.setSize(wish.width, wish.height, false);
    [stage.width, stage.height] = [wish.width, wish.height];
    world.setTheme(wish.dark ? DARK : LIGHT, wish.transparent);
    stage.draw();
    const pen = canvas.getContext("2d");
    if (!pen) throw new Error("this browser gives no canvas for a picture of this size; take a smaller one");
    pen.imageSmoothingQuality = "high";
    pen.drawImage(stage.canvas, 0, 0, wish.width, wish.height);
    wish.write?.(pen);
  } finally {
    renderer.setPixelRatio(before.ratio);
    world.setTheme(wish.dark ? DARK : LIGHT);
    stage.resize(before.width, before.height);
    stage.draw();
  }
  return new Promise((give, fail) => {
    const done = (blob: Blob | null): void =>
      blob ? give(blob) : fail(new Error("this picture is too large for the browser"));
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

/** Pictures of many frames as one zip: frame-000000.png and so on; those of which there are none are left out. */
export async function sequence(frames: number[], draw: (frame: number) => Promise<Blob | null>): Promise<Blob> {
  const files: Record<string, Uint8Array> = {};
  for (const frame of frames) {
    const one = await draw(frame);
    if (!one) continue;
    files[`frame-${String(frame).padStart(6, "0")}.png`] = new Uint8Array(await one.arrayBuffer());
  }
  return new Blob([zipSync(files, { level: 0 }) as Uint8Array<ArrayBuffer>], { type: "application/zip" });
}

const pause = (long: number): Promise<void> => new Promise((go) => setTimeout(go, long));

const FORMS = ["video/webm;codecs=vp9", "video/webm;codecs=vp8", "video/webm"];

/** Whether this browser can write a movie. */
export function canRecord(): boolean {
  return typeof MediaRecorder !== "undefined" && FORMS.some((form) => MediaRecorder.isTypeSupported(form));
}

/** Frames as a WebM movie of what a canvas shows, so many a second. */
export async function movie(
  canvas: HTMLCanvasElement,
  frames: number[],
  perSecond: number,
  show: (frame: number) => Promise<boolean>,
): Promise<Blob> {
  const stream = canvas.captureStream(0);
  const track = stream.getVideoTracks()[0] as CanvasCaptureMediaStreamTrack;
  const form = FORMS.find((f) => MediaRecorder.isTypeSupported(f));
  const recorder = new MediaRecorder(stream, { mimeType: form, videoBitsPerSecond: 12e6 });
  const parts: Blob[] = [];
  recorder.ondataavailable = (event) => parts.push(event.data);
  const done = new Promise<void>((end) => (recorder.onstop = () => end()));
  recorder.start();
  for (const frame of frames) {
    const begun = performance.now();
    if (!(await show(frame))) continue;
    track.requestFrame();
    await pause(Math.max(1000 / perSecond - (performance.now() - begun), 0));
  }
  track.requestFrame(); // the last one again: a recorder that stops too soon loses it
  await pause(300);
  recorder.stop();
  await done;
  track.stop();
  return new Blob(parts, { type: "video/webm" });
}
