// Saving pictures and movies: the dialog, drawing of the frames, and the download.

import type { Told } from "./data/glance";
import type { KeyPart } from "./data/key";
import type { Frame, Manifest } from "./data/types";
import { quantity } from "./data/units";
import { DARK, LIGHT, type World } from "./scene/world";
import type { SettingValues } from "./state";
import { canRecord, download, imageSequence, recordMovie, renderPng } from "./ui/capture";
import { captionScale, writeCaption } from "./ui/caption";
import { type ExportRequest, openExportDialog } from "./ui/dialogs";
import type { Notify } from "./ui/note";
import { lengthBar } from "./ui/overlay";

/** The parts of the page that an export uses. */
export interface ExportContext {
  root: HTMLElement; // parent of the dialog
  world: World;
  manifest: Pick<Manifest, "name" | "times" | "unit">;
  settings: SettingValues;
  picture: { readonly frame: Frame | null; readonly key: KeyPart[]; complete: boolean };
  playback: { stop(): void; go(frame: number): Promise<void> };
  isDark: () => boolean;
  told: () => Told;
  notify: Notify;
}

export class Exporter {
  /** Frames are being saved: nothing else may change the frame. */
  busy = false;
  private last: Partial<ExportRequest> = {};

  constructor(private readonly context: ExportContext) {}

  openDialog(kind: ExportRequest["kind"]): void {
    const { root, manifest, world: { stage } } = this.context;
    const last = manifest.times.length - 1;
    const request: ExportRequest = {
      width: 2 * Math.round(stage.width), height: 2 * Math.round(stage.height), transparent: false,
      caption: true, from: 0, to: last, ...this.last, kind,
    };
    openExportDialog(root, request, last, canRecord(), (answer) => void this.save(answer));
  }

  /** Save the current view at twice its size, without a dialog. */
  saveImage(): Promise<void> {
    const { width, height } = this.context.world.stage;
    const size = { width: 2 * width, height: 2 * height };
    return this.save({ kind: "png", ...size, transparent: false, caption: this.last.caption ?? true, from: 0, to: 0 });
  }

  /** Stop saving frames; false if none were being saved. */
  stop(): boolean {
    const wasBusy = this.busy;
    this.busy = false;
    return wasBusy;
  }

  /** Create the file and start its download. */
  async save(request: ExportRequest): Promise<void> {
    const { manifest, picture, notify } = this.context;
    this.last = request;
    const name = manifest.name.replace(/[^\w.-]+/g, "-") || "grains";
    try {
      if (request.kind === "png") {
        const k = String(picture.frame?.frame ?? 0).padStart(6, "0");
        download(await this.image(request), `${name}-${k}.png`);
        notify("");
      } else {
        notify(await this.saveFrames(request, name));
      }
    } catch (error) {
      notify(`Saving failed: ${(error as Error).message}`);
    }
  }

  /** @param withTold write what is told of the frame as a whole, too */
  image(request: ExportRequest, withTold = false): Promise<Blob> {
    const write = request.caption
      ? (pen: CanvasRenderingContext2D): void => this.write(pen, !request.transparent, withTold)
      : null;
    return renderPng(this.context.world, { ...request, dark: this.context.isDark(), write });
  }

  /** Write time, legend and scale bar on a copy of the canvas. */
  private write(pen: CanvasRenderingContext2D, halo: boolean, withTold = false): void {
    const { picture, manifest, world: { stage }, isDark, told } = this.context;
    const { width, height } = pen.canvas;
    const maxLength = Math.min(140 * captionScale(width, height), 0.25 * width) * (stage.width / width);
    const bar = lengthBar(stage, manifest.unit, maxLength);
    bar.pixels *= width / stage.width; // the canvas of a movie has device pixels
    const time = `t = ${quantity(picture.frame?.time ?? NaN, "s")}`;
    const caption = { time, key: picture.key, bar, theme: isDark() ? DARK : LIGHT, halo };
    writeCaption(pen, withTold ? { ...caption, ...told() } : caption, stage);
  }

  /** A canvas from which a movie is recorded; `copy` draws the current canvas and the caption on it. */
  private movieCanvas(caption: boolean): { canvas: HTMLCanvasElement; copy: () => void } {
    const { canvas: shown } = this.context.world.stage;
    const canvas = document.createElement("canvas");
    [canvas.width, canvas.height] = [shown.width, shown.height];
    const pen = canvas.getContext("2d");
    if (!pen) throw new Error("the browser has no canvas for a movie of this size; make the window smaller");
    const copy = (): void => {
      pen.drawImage(shown, 0, 0, canvas.width, canvas.height);
      if (caption) this.write(pen, true);
    };
    return { canvas, copy };
  }

  /** Save a sequence or a movie; returns the final message. */
  private async saveFrames(request: ExportRequest, name: string): Promise<string> {
    const { settings, playback, picture, notify } = this.context;
    const before = settings.number("frame");
    const frames = Array.from({ length: request.to - request.from + 1 }, (_, k) => request.from + k);
    const missing: number[] = [];
    playback.stop();
    const show = async (k: number): Promise<boolean> => {
      if (!this.busy) return false;
      await playback.go(k);
      if (picture.frame?.frame !== k) missing.push(k);
      notify(`Saving frame ${k} of ${request.to}; press Esc to stop.`);
      return picture.frame?.frame === k;
    };
    this.busy = true;
    picture.complete = true;
    try {
      if (request.kind === "sequence") {
        const draw = async (k: number): Promise<Blob | null> => ((await show(k)) ? this.image(request) : null);
        const zip = await imageSequence(frames, draw);
        if (this.busy) download(zip, `${name}-frames.zip`);
      } else {
        const { canvas, copy } = this.movieCanvas(request.caption);
        const draw = async (k: number): Promise<boolean> => {
          const drawn = await show(k);
          if (drawn) copy();
          return drawn;
        };
        const movie = await recordMovie(canvas, frames, settings.number("speed"), draw);
        if (this.busy) download(movie, `${name}.webm`);
      }
      if (!this.busy) return "Stopped: nothing was saved.";
      return missing.length ? `Not saved, because they could not be shown: frames ${missing.join(", ")}.` : "";
    } finally {
      this.busy = picture.complete = false;
      await playback.go(before);
    }
  }
}
