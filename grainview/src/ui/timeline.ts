// The time line: a slider over frames, ticks where contacts formed or broke, buttons.

import type { Series } from "../data/types";
import { quantity } from "../data/units";
import type { Playback } from "../player";
import { h } from "./dom";
import { button, icon } from "./icons";

/** The last frame not after a time. */
function frameAt(times: number[], time: number): number {
  let [low, high] = [0, times.length - 1];
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (times[middle] <= time * (1 + 1e-12)) low = middle;
    else high = middle - 1;
  }
  return low;
}

/** The frame closest to a time. */
export function nearestFrame(times: number[], time: number): number {
  const before = frameAt(times, time);
  const after = Math.min(before + 1, times.length - 1);
  return times[after] - time < time - times[before] ? after : before;
}

/** The first frame at or after a time, which is the first to show the events of that time. */
function frameAfter(times: number[], time: number): number {
  const before = frameAt(times, time * (1 - 1e-12));
  return times[before] >= time * (1 - 1e-9) ? before : Math.min(before + 1, times.length - 1);
}

interface Events {
  frame: number; // the first frame that shows them
  made: number;
  broken: number;
}

/** What awake grains are. */
const AWAKE = "of clusters whose contacts are integrated; all others move as rigid bodies";

/** Contacts that formed and broke, in words; empty without any. */
function eventText(made: number, broken: number): string {
  const parts = [made ? `${made} formed` : "", broken ? `${broken} broken` : ""].filter(Boolean);
  return parts.length ? `contacts: ${parts.join(", ")}` : "";
}

export class TimeLine {
  readonly slider = h("input", { type: "range", min: 0, step: 1, "aria-label": "Frame", class: "gv-slider" });
  readonly ticks = h("canvas", { class: "gv-ticks", "aria-hidden": "true" });
  /** What the ticks are. */
  private readonly key = h("div", { class: "gv-ticks-key" });
  private readonly label = h("output", { class: "gv-time" });
  private readonly playButton: HTMLButtonElement;
  readonly element: HTMLElement;
  private events: Events[] = [];
  private times: number[] = [];

  constructor(playback: Playback) {
    this.playButton = button("play", "Play", () => playback.toggle(), "space");
    this.slider.addEventListener("input", () => playback.go(Number(this.slider.value)));
    const track = h("div", { class: "gv-track" }, this.slider, this.ticks, this.key);
    this.element = h(
      "div",
      { class: "gv-timeline", role: "group", "aria-label": "Time line" },
      button("first", "First frame", () => playback.go(0), "Home"),
      button("previous", "Previous frame", () => playback.step(-1), "←"),
      this.playButton,
      button("next", "Next frame", () => playback.step(1), "→"),
      button("last", "Last frame", () => playback.go(Infinity), "End"),
      button("previousEvent", "Previous event", () => playback.toEvent(-1), "N"),
      button("nextEvent", "Next event", () => playback.toEvent(1), "n"),
      track,
      this.label,
    );
    new ResizeObserver(() => this.drawTicks()).observe(track);
  }

  setPlaying(on: boolean): void {
    this.playButton.replaceChildren(icon(on ? "pause" : "play"));
    this.playButton.setAttribute("aria-label", on ? "Pause" : "Play");
    this.label.setAttribute("aria-live", on ? "off" : "polite");
  }

  /** Set the times of the frames, and the events. */
  setFrames(times: number[], events: Series["events"]): void {
    this.times = times;
    this.slider.max = String(Math.max(times.length - 1, 0));
    this.slider.disabled = times.length < 2;
    const byFrame = new Map<number, Events>();
    events.time.forEach((time, e) => {
      if (time < times[0]) return; // before the first of the frames
      const frame = frameAfter(times, time);
      const sum = byFrame.get(frame) ?? { frame, made: 0, broken: 0 };
      sum.made += events.made[e];
      sum.broken += events.broken[e];
      byFrame.set(frame, sum);
    });
    this.events = [...byFrame.values()].sort((a, b) => a.frame - b.frame);
    const kinds = [["made", "contacts formed"], ["broken", "contacts broken"]] as const;
    this.key.replaceChildren(...kinds.filter(([kind]) => this.events.some((m) => m[kind]))
      .map(([kind, text]) => h("span", { class: `gv-${kind}` }, text)));
    this.drawTicks();
  }

  /** The next (1) or previous (−1) frame with events; null if there is none. */
  eventFrom(frame: number, direction: 1 | -1): number | null {
    const frames = this.events.map((m) => m.frame).filter((f) => (f - frame) * direction > 0);
    return frames.length ? (direction > 0 ? Math.min(...frames) : Math.max(...frames)) : null;
  }

  /** Events between the previous frame and a frame. */
  private eventsOf(frame: number): { made: number; broken: number } {
    return this.events.find((m) => m.frame === frame) ?? { made: 0, broken: 0 };
  }

  /** Show a frame; `awake`: number of grains of awake clusters, if it is known. */
  show(frame: number, step: number, awake: number | null = null): void {
    this.slider.value = String(frame);
    const { made, broken } = this.eventsOf(frame);
    const events = eventText(made, broken);
    const time = quantity(this.times[frame], "s");
    const moving = awake === null ? "" : `${awake} awake`;
    this.label.textContent = [`t = ${time}`, `frame ${frame} of ${this.times.length - 1}`, moving, events]
      .filter(Boolean)
      .join("  ·  ");
    this.label.title = [`step ${step}`, moving && `grains ${AWAKE}`].filter(Boolean).join("; awake: ");
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
    const thumb = 8; // half the width of the slider's thumb: the position of its first value
    for (const { frame, made, broken } of this.events) {
      const x = thumb + (frame / last) * (width - 2 * thumb);
      pen.fillStyle = style.getPropertyValue("--gv-made");
      if (made) pen.fillRect(x - 0.75, 0, 1.5, height * 0.5);
      pen.fillStyle = style.getPropertyValue("--gv-broken");
      if (broken) pen.fillRect(x - 0.75, height * 0.5, 1.5, height * 0.5);
    }
  }
}
