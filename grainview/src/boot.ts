// From a source and an empty element to a page that can be used, or to a sentence that says why not.

import { linkAddress, lookAs } from "./address";
import { App } from "./app";
import { QUANTITIES } from "./data/quantities";
import type { Source } from "./data/types";
import { layout, sorry } from "./layout";
import { Stage } from "./scene/stage";
import { State } from "./state";

/** Seconds between questions whether a run has gone on. */
const EVERY = 1;

async function build(place: HTMLElement, source: Source, ownPage: boolean): Promise<App> {
  const manifest = await source.manifest(0);
  if (manifest.format !== 1) throw new Error("this page is of another version of SAND than its data; make it anew");
  if (!manifest.times.length) throw new Error("the run has no frames yet; look again when it has written one");
  const [series, grains] = await Promise.all([source.series(), source.grains()]);
  const page = layout(place);
  const known = { manifest, grains };
  const state = new State();
  const there = QUANTITIES.filter((q) => q.available?.(known) ?? true);
  state.offer("colour", there.map((q) => [q.id, q.label]));
  const palettes = Object.keys(manifest.palettes).filter((p) => p !== "diverging");
  state.offer("palette", palettes.map((p) => [p, p]));
  state.offer("plot", series.plots.map((p) => [p.id, p.title]));
  if (ownPage) state.fromAddress(location.hash);
  const look = state.get<string>("look");
  const stage = new Stage(page.canvas);
  const app = new App(source, state, stage, known, series, page);
  if (look) lookAs(stage, look);
  await app.begin();
  if (ownPage) linkAddress(state, stage);
  return app;
}

/** Ask again and again, while a run goes on. */
async function goAlong(app: App): Promise<void> {
  while (app.manifest.running) {
    await new Promise((on) => setTimeout(on, 1000 * EVERY));
    if (!app.page.root.isConnected) return;
    try {
      const more = await app.source.manifest(app.manifest.times.length);
      if (more.times.length || more.running !== app.manifest.running) app.take(more, await app.source.series());
    } catch (error) {
      app.tell((error as Error).message);
      return;
    }
  }
}

/** Show a run in an element; what goes wrong becomes a sentence there. */
export async function show(place: HTMLElement, source: Source, ownPage: boolean): Promise<App | null> {
  try {
    const app = await build(place, source, ownPage);
    void goAlong(app);
    return app;
  } catch (error) {
    sorry(place, (error as Error).message);
    return null;
  }
}
