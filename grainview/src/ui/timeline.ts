// The time line: a slider over frames, ticks where contacts were made or broken, buttons.

import type { Series } from "../data/types";
import { quantity } from "../data/units";
import { h } from "./dom";
import { button, icon } from "./icons";

/** The last frame not after a time. */
export function frameAt(times: number[], time: number): number {
  let [low, high] = [0, times.length - 1];
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (times[middle] <= time * (1 + 1e-12)) low = middle;
    else high = middle - 1;
  }
  return low;
}

/** The frame nearest a time. */
export function nearestFrame(times: number[], time: number): number {
  const before = frameAt(times, time);
  const after = Math.min(before + 1, times.length - 1);
  return times[after] - time < time - times[before] ? after : before;
}

/** The first frame at or after a time: where what happened then is to be seen. */
export function frameAfter(times: number[], time: number): number {
  const before = frameAt(times, time * (1 - 1e-12));
  return times[before] >= time * (1 - 1e-9) ? before : Math.min(before + 1, times.length - 1);
}

export interface Presses {
  play: () => void;
  step: (by: number) => void;
  go: (frame: number) => void;
  event: (direction: 1 | -1) => void;
}

export class TimeLine {
  readonly slider = h("input", { type: "range", min: 0, step: 1, "aria-label": "Frame", class: "gv-slider" });
  readonly ticks = h("canvas", { class: "gv-ticks", "aria-hidden": "true" });
  readonly told = h("output", { class: "gv-time" });
  private readonly playing: HTMLButtonElement;
  readonly element: HTMLElement;
  private marks: { frame: number; made: number; broken: number }[] = [];
  private times: number[] = [];

  constructor(press: Presses) {
    this.playing = button("play", "Play", press.play, "space");
    this.slider.addEventListener("input", () => press.go(Number(this.slider.value)));
    const track = h("div", { class: "gv-track" }, this.slider, this.ticks);
    this.element = h(
      "div",
      { class: "gv-timeline", role: "group", "aria-label": "Time line" },
      button("first", "First frame", () => press.go(0), "Home"),
      button("back", "One frame back", () => press.step(-1), "←"),
      this.playing,
      button("on", "One frame on", () => press.step(1), "→"),
      button("last", "Last frame", () => press.go(Infinity), "End"),
      button("eventBack", "Event before", () => press.event(-1), "N"),
      button("eventOn", "Next event", () => press.event(1), "n"),
      track,
      this.told,
    );
    new ResizeObserver(() => this.drawTicks()).observe(track);
  }

  setPlaying(on: boolean): void {
    this.playing.replaceChildren(icon(on ? "pause" : "play"));
    this.playing.setAttribute("aria-label", on ? "Pause" : "Play");
  }

  /** Frames there are, and events between them. */
  setFrames(times: number[], events: Series["events"]): void {
    this.times = times;
    this.slider.max = String(Math.max(times.length - 1, 0));
    this.slider.disabled = times.length < 2;
    const byFrame = new Map<number, { frame: number; made: number; broken: number }>();
    events.time.forEach((time, e) => {
      if (time < times[0]) return; // before the first frame that is told
      const frame = frameAfter(times, time);
      const mark = byFrame.get(frame) ?? { frame, made: 0, broken: 0 };
      mark.made += events.made[e];
      mark.broken += events.broken[e];
      byFrame.set(frame, mark);
    });
    this.marks = [...byFrame.values()].sort((a, b) => a.frame - b.frame);
    this.drawTicks();
  }

  /** The frame of the next event after (or before) a frame, or null. */
  eventFrom(frame: number, direction: 1 | -1): number | null {
    const later = this.marks.map((m) => m.frame).filter((f) => (f - frame) * direction > 0);
    return later.length ? (direction > 0 ? Math.min(...later) : Math.max(...later)) : null;
  }

  /** What happened on the way to a frame. */
  eventsOf(frame: number): { made: number; broken: number } {
    return this.marks.find((m) => m.frame === frame) ?? { made: 0, broken: 0 };
  }

  show(frame: number, step: number): void {
    this.slider.value = String(frame);
    const { made, broken } = this.eventsOf(frame);
    const happened = [made ? `${made} made` : "", broken ? `${broken} broken` : ""].filter(Boolean).join(", ");
    const time = quantity(this.times[frame], "s");
    this.told.textContent = [`t = ${time}`, `frame ${frame} of ${this.times.length - 1}`, happened]
      .filter(Boolean)
      .join("  ·  ");
    this.told.title = `step ${step}`;
    this.slider.setAttribute("aria-valuetext", `frame ${frame}, ${time}`);
  }

  drawTicks(): void {
    const [width, height] = [this.ticks.clientWidth, this.ticks.clientHeight];
    const pen = this.ticks.getContext("2d");
    if (!pen || !width || !height) return;
    const ratio = window.devicePixelRatio;
    [this.ticks.width, this.ticks.height] = [width * ratio, height * ratio];
    pen.scale(ratio, ratio);
    const style = getComputedStyle(this.ticks);
    const last = Math.max(this.times.length - 1, 1);
    const thumb = 8; // half the slider's thumb: where its first and last value are
    for (const { frame, made, broken } of this.marks) {
      const x = thumb + (frame / last) * (width - 2 * thumb);
      pen.fillStyle = style.getPropertyValue("--gv-made");
      if (made) pen.fillRect(x - 0.75, 0, 1.5, height * 0.5);
      pen.fillStyle = style.getPropertyValue("--gv-broken");
      if (broken) pen.fillRect(x - 0.75, height * 0.5, 1.5, height * 0.5);
    }
  }
}
