// Pictures and movies: what is asked for, made and handed over.

import type { App } from "./app";
import { quantity } from "./data/units";
import { DARK, LIGHT } from "./scene/world";
import { canRecord, download, movie, picture, sequence } from "./ui/capture";
import { growth, writeCaption } from "./ui/caption";
import { askCapture, type CaptureWish } from "./ui/dialogs";
import { lengthBar } from "./ui/overlay";

export class Studio {
  /** Frames are being saved: nothing else shall move the page. */
  busy = false;
  private last: Partial<CaptureWish> = {};

  constructor(private readonly app: App) {}

  ask(kind: CaptureWish["kind"]): void {
    const { app } = this;
    const last = app.manifest.times.length - 1;
    const wish: CaptureWish = {
      width: 2 * Math.round(app.stage.width), height: 2 * Math.round(app.stage.height), transparent: false,
      words: true, from: 0, to: last, ...this.last, kind,
    };
    askCapture(app.page.root, wish, last, canRecord(), (told) => void this.make(told));
  }

  /** What the page shows, at twice its size. */
  quick(): Promise<void> {
    const { width, height } = this.app.stage;
    const size = { width: 2 * width, height: 2 * height };
    return this.make({ kind: "png", ...size, transparent: false, words: this.last.words ?? true, from: 0, to: 0 });
  }

  /** No more frames are saved; false if none were. */
  stop(): boolean {
    const was = this.busy;
    this.busy = false;
    return was;
  }

  /** Make it and hand it to the browser as a download. */
  async make(wish: CaptureWish): Promise<void> {
    const { app } = this;
    this.last = wish;
    const name = app.manifest.name.replace(/[^\w.-]+/g, "-") || "grains";
    try {
      if (wish.kind === "png") {
        const k = String(app.picture.frame?.frame ?? 0).padStart(6, "0");
        download(await this.still(wish), `${name}-${k}.png`);
        app.tell("");
      } else {
        app.tell(await this.many(wish, name));
      }
    } catch (error) {
      app.tell(`This could not be saved: ${(error as Error).message}`);
    }
  }

  still(wish: CaptureWish): Promise<Blob> {
    const write = wish.words ? (pen: CanvasRenderingContext2D): void => this.write(pen, !wish.transparent) : null;
    return picture(this.app.world, { ...wish, dark: this.app.dark, write });
  }

  /** Time, legend and scale bar of what the stage shows, onto a copy of it. */
  private write(pen: CanvasRenderingContext2D, halo: boolean): void {
    const { picture: shown, stage, manifest, dark } = this.app;
    const { width, height } = pen.canvas;
    const most = Math.min(140 * growth(width, height), 0.25 * width) * (stage.width / width);
    const bar = lengthBar(stage, manifest.unit, most);
    bar.pixels *= width / stage.width; // of a movie, which has the pixels of the screen
    const time = `t = ${quantity(shown.frame?.time ?? NaN, "s")}`;
    writeCaption(pen, { time, key: shown.key, bar, theme: dark ? DARK : LIGHT, halo });
  }

  /** A movie is recorded from a copy of the canvas, onto which `copy` brings what that shows, and the words. */
  private film(words: boolean): { canvas: HTMLCanvasElement; copy: () => void } {
    const { canvas: shown } = this.app.page;
    const canvas = document.createElement("canvas");
    [canvas.width, canvas.height] = [shown.width, shown.height];
    const pen = canvas.getContext("2d");
    if (!pen) throw new Error("this browser gives no canvas for a movie of this size; make the window smaller");
    const copy = (): void => {
      pen.drawImage(shown, 0, 0, canvas.width, canvas.height);
      if (words) this.write(pen, true);
    };
    return { canvas, copy };
  }

  /** Many frames, one after another; what is to be said of it in the end. */
  private async many(wish: CaptureWish, name: string): Promise<string> {
    const { app } = this;
    const before = app.state.number("frame");
    const frames = Array.from({ length: wish.to - wish.from + 1 }, (_, k) => wish.from + k);
    const missing: number[] = [];
    app.player.stop();
    const show = async (k: number): Promise<boolean> => {
      if (!this.busy) return false;
      await app.go(k);
      if (app.picture.frame?.frame !== k) missing.push(k);
      app.tell(`saving: frame ${k} of ${wish.to}; Esc stops it`);
      return app.picture.frame?.frame === k;
    };
    this.busy = true;
    app.picture.patient = true;
    try {
      if (wish.kind === "sequence") {
        const draw = async (k: number): Promise<Blob | null> => ((await show(k)) ? this.still(wish) : null);
        const zip = await sequence(frames, draw);
        if (this.busy) download(zip, `${name}-frames.zip`);
      } else {
        const { canvas, copy } = this.film(wish.words);
        const draw = async (k: number): Promise<boolean> => {
          const there = await show(k);
          if (there) copy();
          return there;
        };
        const film = await movie(canvas, frames, app.state.number("speed"), draw);
        if (this.busy) download(film, `${name}.webm`);
      }
      if (!this.busy) return "Stopped: nothing was saved.";
      return missing.length ? `Left out, because they could not be shown: frames ${missing.join(", ")}.` : "";
    } finally {
      this.busy = app.picture.patient = false;
      await app.go(before);
    }
  }
}
