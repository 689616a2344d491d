// The parts of the page and where they are.

import { h } from "./ui/dom";
import { button } from "./ui/icons";

export interface Layout {
  root: HTMLElement;
  header: HTMLElement;
  title: HTMLElement;
  told: HTMLElement;
  canvas: HTMLCanvasElement;
  view: HTMLElement;
  legend: HTMLElement;
  bottom: HTMLElement;
  side: HTMLElement;
  note: HTMLElement;
}

/** An empty page in an element. */
export function layout(place: HTMLElement): Layout {
  const title = h("h1", {});
  const told = h("p", { class: "gv-told" });
  const canvas = h("canvas", { class: "gv-canvas", role: "img", tabindex: 0, "aria-label": "Grains" });
  const legend = h("section", { class: "gv-legend", "aria-label": "Legend" });
  const note = h("p", { class: "gv-note", role: "alert", hidden: true });
  const view = h("div", { class: "gv-view" }, canvas, legend, note);
  const bottom = h("div", { class: "gv-bottom" });
  const side = h("div", { class: "gv-side" });
  const header = h("header", {}, h("div", { class: "gv-names" }, title, told));
  const root = h("div", { class: "gv", tabindex: -1 }, header, h("main", {}, view, side), bottom);
  place.replaceChildren(root);
  return { root, header, title, told, canvas, view, legend, bottom, side, note };
}

/** A page that says why there is nothing to see. */
export function sorry(place: HTMLElement, sentence: string): void {
  place.replaceChildren(
    h("div", { class: "gv gv-sorry", role: "alert" }, h("h1", {}, "Nothing to show"), h("p", {}, sentence)),
  );
}

/** Buttons at the right of the header. */
export function headerButtons(
  press: Record<"centre" | "picture" | "help" | "panel", () => void> & { link: (() => void) | null },
): HTMLElement {
  const panel = button("panel", "Settings", press.panel, "`");
  panel.classList.add("gv-shows-panel");
  panel.setAttribute("aria-controls", "gv-panel");
  panel.setAttribute("aria-expanded", "true");
  return h(
    "nav",
    { "aria-label": "Page" },
    button("centre", "Centre", press.centre, "z"),
    button("camera", "Picture or movie", press.picture, "s"),
    ...(press.link ? [button("link", "Copy the address of this view", press.link, "j")] : []),
    button("help", "Keys and help", press.help, "?"),
    panel,
  );
}
