// Pictures and movies: what is asked for, made and handed over.

import type { App } from "./app";
import { canRecord, download, movie, picture, sequence } from "./ui/capture";
import { askCapture, type CaptureWish } from "./ui/dialogs";

export class Studio {
  private last: Partial<CaptureWish> = {};

  constructor(private readonly app: App) {}

  ask(kind: CaptureWish["kind"]): void {
    const { app } = this;
    const last = app.manifest.times.length - 1;
    const wish: CaptureWish = {
      width: 2 * Math.round(app.stage.width), height: 2 * Math.round(app.stage.height), transparent: false,
      from: 0, to: last, ...this.last, kind,
    };
    askCapture(app.page.root, wish, last, canRecord(), (told) => void this.make(told));
  }

  /** What the page shows, at twice its size. */
  quick(): Promise<void> {
    const { width, height } = this.app.stage;
    return this.make({ kind: "png", width: 2 * width, height: 2 * height, transparent: false, from: 0, to: 0 });
  }

  /** Make it and hand it to the browser as a download. */
  async make(wish: CaptureWish): Promise<void> {
    const { app } = this;
    this.last = wish;
    const name = app.manifest.name.replace(/[^\w.-]+/g, "-") || "grains";
    try {
      if (wish.kind === "png") {
        const k = String(app.state.number("frame")).padStart(6, "0");
        download(await this.still(wish), `${name}-${k}.png`);
      } else {
        await this.many(wish, name);
      }
      app.tell("");
    } catch (error) {
      app.tell(`This could not be saved: ${(error as Error).message}`);
    }
  }

  still(wish: CaptureWish): Promise<Blob> {
    return picture(this.app.world, { ...wish, dark: this.app.dark });
  }

  private async many(wish: CaptureWish, name: string): Promise<void> {
    const { app } = this;
    const before = app.state.number("frame");
    const frames = Array.from({ length: wish.to - wish.from + 1 }, (_, k) => wish.from + k);
    app.player.stop();
    const show = async (k: number): Promise<void> => {
      await app.go(k);
      app.tell(`saving: frame ${k} of ${wish.to}`);
    };
    if (wish.kind === "sequence") {
      const draw = async (k: number): Promise<Blob> => {
        await show(k);
        return this.still(wish);
      };
      download(await sequence(frames, draw), `${name}-frames.zip`);
    } else {
      download(await movie(app.page.canvas, frames, app.state.number("speed"), show), `${name}.webm`);
    }
    await app.go(before);
  }
}
