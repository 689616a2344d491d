// Builds the page in an empty element from a data source, or shows there why that is impossible.

import { App } from "./app";
import type { Source } from "./data/types";
import { layout, showFailure } from "./layout";
import { offerChoices, pollRun } from "./live";
import { Stage } from "./scene/stage";
import { State } from "./state";

/** @param ownsAddress the page has an address of its own, which is not so in a notebook */
async function build(parent: HTMLElement, source: Source, ownsAddress: boolean): Promise<App> {
  const manifest = await source.manifest(0);
  if (manifest.format !== 1) throw new Error("this page was made by another version of SAND than its data; rebuild it");
  if (!manifest.times.length) throw new Error("the run has no frames yet; reload the page when it has written one");
  const [series, grains] = await Promise.all([source.series(), source.grains()]);
  const page = layout(parent);
  const dataset = { manifest, grains };
  const state = new State();
  const palettes = Object.keys(manifest.palettes).filter((p) => p !== "diverging");
  state.offer("palette", palettes.map((p) => [p, p]));
  offerChoices(state, dataset, series);
  state.setting("grain").to = manifest.grains - 1;
  const isShared = ownsAddress && location.hash.length > 1; // an address with settings
  if (isShared) state.fromAddress(location.hash);
  else state.set("frame", manifest.times.length - 1);
  const stage = new Stage(page.canvas);
  const app = new App(source, state, stage, dataset, series, page, ownsAddress);
  await app.start(state.get<string>("look"), !isShared);
  return app;
}

/** Show a run in an element, or the message of the error that prevents it. */
export async function show(parent: HTMLElement, source: Source, ownsAddress: boolean): Promise<App | null> {
  try {
    const app = await build(parent, source, ownsAddress);
    void pollRun(app, source);
    return app;
  } catch (error) {
    showFailure(parent, (error as Error).message);
    return null;
  }
}
