// The elements of the page and their arrangement.

import { h } from "./ui/dom";
import { button } from "./ui/icons";

export interface Layout {
  root: HTMLElement;
  header: HTMLElement;
  title: HTMLElement;
  status: HTMLElement;
  canvas: HTMLCanvasElement;
  view: HTMLElement; // canvas with overlay
  legend: HTMLElement; // over the canvas, or beside it on a small screen
  bottom: HTMLElement;
  side: HTMLElement; // what is told of the frame and of the selection, and the settings
  glance: HTMLElement;
  note: HTMLElement;
}

/** Build an empty page in an element. */
export function layout(parent: HTMLElement): Layout {
  const title = h("h1", {});
  const status = h("p", { class: "gv-status" });
  const canvas = h("canvas", { class: "gv-canvas", role: "img", tabindex: 0, "aria-label": "Grains" });
  const legend = h("section", { class: "gv-legend", "aria-label": "Legend" });
  const note = h("p", { class: "gv-note", role: "alert", hidden: true });
  const view = h("div", { class: "gv-view" }, canvas, note);
  const scene = h("div", { class: "gv-scene" }, view, legend);
  const bottom = h("div", { class: "gv-bottom" });
  const glance = h("section", { class: "gv-glance", "aria-label": "Frame" });
  const side = h("div", { class: "gv-side" }, glance);
  const header = h("header", {}, h("div", { class: "gv-names" }, title, status));
  const root = h("div", { class: "gv", tabindex: -1 }, header, h("main", {}, scene, side), bottom);
  parent.replaceChildren(root);
  return { root, header, title, status, canvas, view, legend, bottom, side, glance, note };
}

/** Show or hide the settings. */
export function togglePanel({ root, header }: Layout): void {
  const hidden = root.classList.toggle("gv-panel-hidden");
  header.querySelector(".gv-shows-panel")?.setAttribute("aria-expanded", String(!hidden));
}

/** Show an error message in place of the page. */
export function showFailure(parent: HTMLElement, message: string): void {
  parent.replaceChildren(
    h("div", { class: "gv gv-failure", role: "alert" }, h("h1", {}, "Nothing to show"), h("p", {}, message)),
  );
}

export interface HeaderCommands {
  showLargest: () => void;
  showAll: () => void;
  centre: () => void;
  savePicture: () => void;
  copyAddress: (() => void) | null; // null: no button
  help: () => void;
  togglePanel: () => void;
}

/** Buttons at the right of the header. */
export function headerButtons(commands: HeaderCommands): HTMLElement {
  const { copyAddress } = commands;
  const panel = button("panel", "Settings", commands.togglePanel, "`");
  panel.classList.add("gv-shows-panel");
  panel.setAttribute("aria-controls", "gv-panel");
  panel.setAttribute("aria-expanded", "true");
  return h(
    "nav",
    { "aria-label": "Page" },
    button("cluster", "Largest cluster", commands.showLargest, "Y"),
    button("box", "Whole box", commands.showAll, "r"),
    button("centre", "Centre", commands.centre, "z"),
    button("camera", "Picture or movie", commands.savePicture, "s"),
    ...(copyAddress ? [button("link", "Copy the address of this view", copyAddress, "j")] : []),
    button("help", "Keys and help", commands.help, "?"),
    panel,
  );
}
