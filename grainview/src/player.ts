// Playing: one frame after another, so many a second, none left out.

import type { State } from "./state";

export class Player {
  playing = false;
  private round = 0; // counts how often playing has begun: an earlier one that still waits must not go on
  onPlaying: (on: boolean) => void = () => undefined;

  constructor(
    private readonly state: State,
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
    const round = ++this.round;
    this.onPlaying(true);
    if (this.state.number("frame") >= this.count() - 1) await this.go(0);
    while (this.playing && this.round === round) {
      const begun = performance.now();
      const next = this.state.number("frame") + 1;
      if (next >= this.count() && !this.state.get<boolean>("loop")) break;
      await this.go(next % this.count());
      const wait = 1000 / this.state.number("speed") - (performance.now() - begun);
      await new Promise((on) => setTimeout(on, Math.max(wait, 0)));
    }
    if (this.round === round) this.stop();
  }
}
