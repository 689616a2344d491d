// Frames that have been looked at are kept, as many as fit; those to come are fetched ahead.

import type { Frame, Source } from "./types";

/** Bytes of frames kept, unless all of them are smaller. */
const KEPT = 160e6;

export class Frames {
  private readonly ready = new Map<number, Frame>();
  private readonly asked = new Map<number, Promise<Frame>>();
  private size = 0;

  constructor(private readonly source: Source) {}

  get(k: number): Promise<Frame> {
    const here = this.ready.get(k);
    if (here) {
      this.ready.delete(k); // the last looked at are the last to go
      this.ready.set(k, here);
      return Promise.resolve(here);
    }
    let coming = this.asked.get(k);
    if (!coming) {
      coming = this.source.frame(k).then((frame) => this.keep(k, frame)).finally(() => this.asked.delete(k));
      this.asked.set(k, coming);
    }
    return coming;
  }

  /** The frame, or the nearest of those that can be read; fails as the frame itself if none of some can be. */
  async nearest(k: number, count: number): Promise<Frame> {
    let first: unknown;
    for (const step of [0, -1, 1, -2, 2, -3, 3, -k, count - 1 - k]) {
      if (k + step < 0 || k + step >= count) continue;
      try {
        return await this.get(k + step);
      } catch (error) {
        first ??= error;
      }
    }
    throw first;
  }

  /** Begin to fetch, without waiting and without complaint. */
  prefetch(k: number, count: number): void {
    if (k >= 0 && k < count && !this.ready.has(k) && this.asked.size < 2) void this.get(k).catch(() => undefined);
  }

  private keep(k: number, frame: Frame): Frame {
    this.ready.set(k, frame);
    this.size += frame.bytes;
    for (const [old, one] of this.ready) {
      if (this.size <= KEPT || this.ready.size <= 3) break;
      this.ready.delete(old);
      this.size -= one.bytes;
    }
    return frame;
  }
}
