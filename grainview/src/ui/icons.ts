// Icons of buttons, as paths: not every system has a font with them.

import { h, svg } from "./dom";

const PATHS = {
  play: "M5 3l9 5-9 5z",
  pause: "M4 3h3v10H4zM9 3h3v10H9z",
  first: "M3 3h2v10H3zM13 3v10L6 8z",
  last: "M11 3h2v10h-2zM3 3l7 5-7 5z",
  previous: "M11 3v10L4 8z",
  next: "M5 3l7 5-7 5z",
  previousEvent: "M7.5 3v10L1.5 8zM14 3v10L8 8z",
  nextEvent: "M8.5 3l6 5-6 5zM2 3l6 5-6 5z",
  cluster: ["M5 6", "M10.2 6", "M7.6 10.5"]
    .map((centre) => `${centre}m-2.6 0a2.6 2.6 0 1 0 5.2 0a2.6 2.6 0 1 0-5.2 0`).join(""),
  box: "M2.5 5l5.5-3 5.5 3v6L8 14l-5.5-3zM2.5 5L8 8l5.5-3M8 8v6",
  centre: "M8 1v4M8 11v4M1 8h4M11 8h4M8 8m-3.5 0a3.5 3.5 0 1 0 7 0a3.5 3.5 0 1 0-7 0",
  camera: "M2 5h3l1-2h4l1 2h3v8H2zM8 9m-2.4 0a2.4 2.4 0 1 0 4.8 0a2.4 2.4 0 1 0-4.8 0",
  link: "M7 9a3 3 0 0 0 4.3 0l2-2A3 3 0 0 0 9 2.7l-1 1M9 7a3 3 0 0 0-4.3 0l-2 2A3 3 0 0 0 7 13.3l1-1",
  help: "M5.5 6a2.5 2.5 0 1 1 3.6 2.2C8.3 8.7 8 9.2 8 10M8 12.3v.4",
  panel: "M2 4h12M2 8h12M2 12h12",
  close: "M4 4l8 8M12 4l-8 8",
} as const;

type Icon = keyof typeof PATHS;

const FILLED = new Set<Icon>(["play", "pause", "first", "last", "previous", "next", "previousEvent", "nextEvent"]);

export function icon(name: Icon): SVGElement {
  const element = svg("svg", { viewBox: "0 0 16 16", class: "gv-icon", "aria-hidden": "true" });
  element.append(svg("path", { d: PATHS[name], class: FILLED.has(name) ? "gv-filled" : "gv-drawn" }));
  return element;
}

/** A button with an icon, a label for screen readers, and its key in the tooltip. */
export function button(name: Icon, label: string, press: () => void, key = ""): HTMLButtonElement {
  const title = key ? `${label} (${key})` : label;
  return h("button", { type: "button", "aria-label": label, title, click: press }, icon(name));
}
