// Entry points: a page of SAND starts by itself; a notebook calls `render` (anywidget).

import "uplot/dist/uPlot.min.css";
import "./style.css";
import type { App } from "./app";
import { show } from "./boot";
import { EmbeddedSource, ServerSource } from "./data/source";
import { h } from "./ui/dom";
import { type Model, WidgetSource } from "./widget";

declare global {
  interface Window {
    sandView?: App | null; // for tests and for scripts in the browser's console
  }
}

const parent = document.getElementById("grainview");
if (parent) {
  const embedded = EmbeddedSource.isPresent() || location.protocol === "file:";
  void show(parent, embedded ? new EmbeddedSource() : new ServerSource(), true).then((app) => {
    window.sandView = app;
    parent.dataset.ready = app ? "yes" : "no"; // tests wait for this attribute
  });
}

function render({ model, el }: { model: Model; el: HTMLElement }): () => void {
  const cell = h("div", { class: "gv-cell" });
  el.append(cell);
  const source = new WidgetSource(model);
  const started = show(cell, source, false);
  return () => {
    source.close();
    void started.then((app) => app?.dispose());
  };
}

export default { render };
