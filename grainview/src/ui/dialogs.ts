// Modal dialogs: help, and the options of a picture or a movie.

import { MAX_SIZE } from "./capture";
import { h } from "./dom";
import { icon } from "./icons";

/** Open a modal dialog, replacing an open one; Esc closes it. */
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
  dialog.addEventListener("keydown", (event) => event.stopPropagation()); // the keys of the page are off
  root.append(dialog);
  dialog.showModal();
  return dialog;
}

export interface ExportRequest {
  width: number;
  height: number;
  transparent: boolean;
  caption: boolean; // time, legend and scale bar
  kind: "png" | "sequence" | "webm";
  from: number;
  to: number;
}

function numberField(id: string, label: string, value: number, min: number, max: number): HTMLElement {
  const input = h("input", { id, type: "number", min, max, step: 1, value, required: true });
  return h("p", {}, h("label", { for: id }, label), input);
}

/** Ask for size, format and frames; `submit` is called with the answer. */
export function openExportDialog(
  root: HTMLElement,
  initial: ExportRequest,
  lastFrame: number,
  canRecord: boolean,
  submit: (request: ExportRequest) => void,
): void {
  const kinds: [string, string][] = [["png", "one picture (PNG)"], ["sequence", "pictures of frames (PNG, zip)"]];
  if (canRecord) kinds.push(["webm", "movie (WebM)"]);
  const kind = h("select", { id: "gv-cap-kind" }, ...kinds.map(([value, label]) => h("option", { value }, label)));
  kind.value = initial.kind === "webm" && !canRecord ? "sequence" : initial.kind;
  const transparent = h("input", { id: "gv-cap-clear", type: "checkbox" });
  transparent.checked = initial.transparent;
  const caption = h("input", { id: "gv-cap-words", type: "checkbox" });
  caption.checked = initial.caption;
  const form = h(
    "form",
    { method: "dialog" },
    h("p", {}, h("label", { for: "gv-cap-kind" }, "Format"), kind),
    numberField("gv-cap-width", "Width (pixels)", initial.width, 16, MAX_SIZE),
    numberField("gv-cap-height", "Height (pixels)", initial.height, 16, MAX_SIZE),
    numberField("gv-cap-from", "From frame", initial.from, 0, lastFrame),
    numberField("gv-cap-to", "To frame", initial.to, 0, lastFrame),
    h("p", {}, h("label", { for: "gv-cap-clear" }, "Transparent background"), transparent),
    h("p", {}, h("label", { for: "gv-cap-words" }, "Time, legend and scale bar"), caption),
    h("p", { class: "gv-faint" }, "Axes and selected values are left out. A movie has the size of the canvas."),
    h("button", { type: "submit", class: "gv-go" }, "Save"),
  );
  const value = (id: string): number => Number((form.querySelector(`#${id}`) as HTMLInputElement).value);
  form.addEventListener("submit", () =>
    submit({
      width: value("gv-cap-width"),
      height: value("gv-cap-height"),
      from: Math.min(value("gv-cap-from"), value("gv-cap-to")),
      to: Math.max(value("gv-cap-from"), value("gv-cap-to")),
      transparent: transparent.checked,
      caption: caption.checked,
      kind: kind.value as ExportRequest["kind"],
    }),
  );
  const enableFields = (): void => {
    const input = (id: string): HTMLInputElement => form.querySelector(`#${id}`) as HTMLInputElement;
    for (const id of ["gv-cap-from", "gv-cap-to"]) input(id).disabled = kind.value === "png";
    for (const id of ["gv-cap-width", "gv-cap-height", "gv-cap-clear"]) input(id).disabled = kind.value === "webm";
  };
  kind.addEventListener("change", enableFields);
  enableFields();
  openDialog(root, "Picture or movie", form);
  kind.focus();
}
