// Playing: frames in sequence at a given rate; none is skipped.

import type { SettingValues } from "./state";

/** Commands of the time line and of the keyboard. */
export interface Playback {
  toggle(): void;
  go(frame: number): void;
  step(by: number): void;
  /** Go to the next (1) or the previous (−1) frame in which contacts formed or broke. */
  toEvent(direction: 1 | -1): void;
}

export class Player {
  playing = false;
  private generation = 0; // number of starts: a loop of an earlier start that still waits must end
  onPlaying: (on: boolean) => void = () => undefined;

  /**
   * @param count number of frames, which grows while the run continues
   * @param go shows a frame
   */
  constructor(
    private readonly settings: SettingValues,
    private readonly count: () => number,
    private readonly go: (frame: number) => Promise<void>,
  ) {}

  toggle(): void {
    if (this.playing) this.stop();
    else void this.play();
  }

  stop(): void {
    this.playing = false;
    this.onPlaying(false);
  }

  async play(): Promise<void> {
    if (this.playing || this.count() < 2) return;
    this.playing = true;
    const generation = ++this.generation;
    this.onPlaying(true);
    if (this.settings.number("frame") >= this.count() - 1) await this.go(0);
    while (this.playing && this.generation === generation) {
      const start = performance.now();
      const next = this.settings.number("frame") + 1;
      if (next >= this.count() && !this.settings.get<boolean>("loop")) break;
      await this.go(next % this.count());
      const wait = 1000 / this.settings.number("speed") - (performance.now() - start);
      await new Promise((resolve) => setTimeout(resolve, Math.max(wait, 0)));
    }
    if (this.generation === generation) this.stop();
  }
}
