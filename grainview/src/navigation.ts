// Which frame is shown. Frames load asynchronously; of several requests only the last one is shown.

import type { Frame } from "./data/types";
import type { Settings } from "./state";

/** Frames by number, loaded on request. */
export interface FrameStore {
  get(k: number): Promise<Frame>;
  prefetch(k: number, count: number): void;
}

export interface FrameDisplay {
  showFrame(k: number, frame: Frame): void;
  showError(k: number, error: Error): void;
}

export class FrameNavigation {
  /** Settles when the frame requested last is shown, or could not be loaded. */
  showing: Promise<void> = Promise.resolve();
  private requested = 0;

  /** @param count number of frames, which grows while the run continues */
  constructor(
    private readonly settings: Settings,
    private readonly frames: FrameStore,
    private readonly count: () => number,
    private readonly display: FrameDisplay,
  ) {}

  /** Go to a frame; a number beyond the last frame means the last frame. */
  go(frame: number): Promise<void> {
    const last = this.count() - 1;
    const k = Math.min(Math.max(Math.round(Math.min(frame, last)), 0), last);
    if (k === this.settings.number("frame")) void this.show();
    else this.settings.set("frame", k); // whose listener calls `show`
    return this.showing;
  }

  step(by: number): Promise<void> {
    return this.go(this.settings.number("frame") + by);
  }

  /** Show the frame of the setting. */
  show(): Promise<void> {
    const k = Math.min(this.settings.number("frame"), this.count() - 1);
    this.requested = k;
    this.showing = this.frames.get(k).then(
      (frame) => {
        if (this.requested !== k) return this.showing; // superseded
        this.display.showFrame(k, frame);
        this.frames.prefetch(k + 1 < this.count() ? k + 1 : 0, this.count());
        return undefined;
      },
      (error: Error) => {
        if (this.requested !== k) return this.showing;
        this.display.showError(k, error);
        return undefined;
      },
    );
    return this.showing;
  }
}
