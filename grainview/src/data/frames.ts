// Frames that have been looked at are kept, as many as fit; those to come are fetched ahead.

import type { Frame, Source } from "./types";

/** Bytes of frames kept, unless all of them are smaller. */
const KEPT = 160e6;

export class Frames {
  private readonly ready = new Map<number, Frame>();
  private readonly asked = new Map<number, Promise<Frame>>();
  private size = 0;

  constructor(private readonly source: Source) {}

  /** A frame that is here already. */
  peek(k: number): Frame | undefined {
    return this.ready.get(k);
  }

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
