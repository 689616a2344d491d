// Where the page begins: of its own accord in a page of SAND, and `render` for a notebook (anywidget).

import "uplot/dist/uPlot.min.css";
import "./style.css";
import type { App } from "./app";
import { show } from "./boot";
import { EmbeddedSource, ServerSource } from "./data/source";
import { h } from "./ui/dom";
import { type Model, WidgetSource } from "./widget";

declare global {
  interface Window {
    sandView?: App | null; // for tests, and for those who want to script the page
  }
}

const place = document.getElementById("grainview");
if (place) {
  const source = EmbeddedSource.isThere() || location.protocol === "file:" ? new EmbeddedSource() : new ServerSource();
  void show(place, source, true).then((app) => {
    window.sandView = app;
    place.dataset.ready = app ? "yes" : "no"; // for tests: a policy may forbid them to wait for anything but elements
  });
}

function render({ model, el }: { model: Model; el: HTMLElement }): () => void {
  const inside = h("div", { class: "gv-cell" });
  el.append(inside);
  const source = new WidgetSource(model);
  const coming = show(inside, source, false);
  return () => {
    source.close();
    void coming.then((app) => {
      app?.player.stop();
      app?.plot.dispose();
      app?.stage.dispose();
    });
  };
}

export default { render };
