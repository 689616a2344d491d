// Cache of frames: the most recently used ones are kept, the next one is loaded in advance.

import type { Frame, Source } from "./types";

/** Size of the cache [bytes]; at least three frames are kept. */
const CAPACITY = 160e6;

export class Frames {
  private readonly loaded = new Map<number, Frame>();
  private readonly pending = new Map<number, Promise<Frame>>();
  private size = 0;

  constructor(private readonly source: Source) {}

  get(k: number): Promise<Frame> {
    const frame = this.loaded.get(k);
    if (frame) {
      this.loaded.delete(k); // moves the frame to the end: the map is in the order of last use
      this.loaded.set(k, frame);
      return Promise.resolve(frame);
    }
    let request = this.pending.get(k);
    if (!request) {
      request = this.source.frame(k).then((frame) => this.keep(k, frame)).finally(() => this.pending.delete(k));
      this.pending.set(k, request);
    }
    return request;
  }

  /** The frame, or one near it that can be read; fails with the error of the first one tried if none can. */
  async nearest(k: number, count: number): Promise<Frame> {
    let firstError: unknown;
    for (const step of [0, -1, 1, -2, 2, -3, 3, -k, count - 1 - k]) {
      if (k + step < 0 || k + step >= count) continue;
      try {
        return await this.get(k + step);
      } catch (error) {
        firstError ??= error;
      }
    }
    throw firstError;
  }

  /** Start to load a frame; errors are ignored. */
  prefetch(k: number, count: number): void {
    if (k >= 0 && k < count && !this.loaded.has(k) && this.pending.size < 2) void this.get(k).catch(() => undefined);
  }

  private keep(k: number, frame: Frame): Frame {
    this.loaded.set(k, frame);
    this.size += frame.bytes;
    for (const [old, dropped] of this.loaded) {
      if (this.size <= CAPACITY || this.loaded.size <= 3) break;
      this.loaded.delete(old);
      this.size -= dropped.bytes;
    }
    return frame;
  }
}
