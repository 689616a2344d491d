// Windows over the page: help, and what a picture or a movie shall be like.

import { LARGEST } from "./capture";
import { h } from "./dom";
import { icon } from "./icons";

/** Show content in a window that Esc closes. */
export function openDialog(root: HTMLElement, title: string, ...content: (Node | string)[]): HTMLDialogElement {
  root.querySelector("dialog")?.remove();
  const close = h("button", { type: "button", "aria-label": "Close", class: "gv-close" }, icon("close"));
  const dialog = h("dialog", { class: "gv-dialog", "aria-label": title }, close, h("h2", {}, title), ...content);
  close.addEventListener("click", () => dialog.close());
  const before = document.activeElement as HTMLElement | null;
  dialog.addEventListener("close", () => {
    dialog.remove();
    if (document.activeElement === document.body) before?.focus();
  });
  dialog.addEventListener("keydown", (event) => event.stopPropagation()); // Esc closes it, and does nothing else
  root.append(dialog);
  dialog.showModal();
  return dialog;
}

export interface CaptureWish {
  width: number;
  height: number;
  transparent: boolean;
  words: boolean; // time, legend and scale bar
  kind: "png" | "sequence" | "webm";
  from: number;
  to: number;
}

function number(id: string, label: string, value: number, least: number, most: number): HTMLElement {
  const input = h("input", { id, type: "number", min: least, max: most, step: 1, value, required: true });
  return h("p", {}, h("label", { for: id }, label), input);
}

/** Ask for size, kind and frames; `go` gets the answer. */
export function askCapture(
  root: HTMLElement,
  initial: CaptureWish,
  lastFrame: number,
  webm: boolean,
  go: (wish: CaptureWish) => void,
): void {
  const kinds: [string, string][] = [["png", "one picture (PNG)"], ["sequence", "pictures of frames (PNG, zip)"]];
  if (webm) kinds.push(["webm", "movie (WebM)"]);
  const kind = h("select", { id: "gv-cap-kind" }, ...kinds.map(([value, label]) => h("option", { value }, label)));
  kind.value = initial.kind === "webm" && !webm ? "sequence" : initial.kind;
  const clear = h("input", { id: "gv-cap-clear", type: "checkbox" });
  clear.checked = initial.transparent;
  const words = h("input", { id: "gv-cap-words", type: "checkbox" });
  words.checked = initial.words;
  const form = h(
    "form",
    { method: "dialog" },
    h("p", {}, h("label", { for: "gv-cap-kind" }, "What"), kind),
    number("gv-cap-width", "Width (pixels)", initial.width, 16, LARGEST),
    number("gv-cap-height", "Height (pixels)", initial.height, 16, LARGEST),
    number("gv-cap-from", "From frame", initial.from, 0, lastFrame),
    number("gv-cap-to", "To frame", initial.to, 0, lastFrame),
    h("p", {}, h("label", { for: "gv-cap-clear" }, "Transparent background"), clear),
    h("p", {}, h("label", { for: "gv-cap-words" }, "Time, legend and scale bar"), words),
    h("p", { class: "gv-faint" }, "Without axes and numbers. A movie is as large as the picture on the page."),
    h("button", { type: "submit", class: "gv-go" }, "Save"),
  );
  const value = (id: string): number => Number((form.querySelector(`#${id}`) as HTMLInputElement).value);
  form.addEventListener("submit", () =>
    go({
      width: value("gv-cap-width"),
      height: value("gv-cap-height"),
      from: Math.min(value("gv-cap-from"), value("gv-cap-to")),
      to: Math.max(value("gv-cap-from"), value("gv-cap-to")),
      transparent: clear.checked,
      words: words.checked,
      kind: kind.value as CaptureWish["kind"],
    }),
  );
  const suit = (): void => {
    const input = (id: string): HTMLInputElement => form.querySelector(`#${id}`) as HTMLInputElement;
    for (const id of ["gv-cap-from", "gv-cap-to"]) input(id).disabled = kind.value === "png";
    for (const id of ["gv-cap-width", "gv-cap-height", "gv-cap-clear"]) input(id).disabled = kind.value === "webm";
  };
  kind.addEventListener("change", suit);
  suit();
  openDialog(root, "Picture or movie", form);
  kind.focus();
}
