// From a source and an empty element to a page that can be used, or to a sentence that says why not.

import { linkAddress } from "./address";
import { App } from "./app";
import type { Source } from "./data/types";
import { layout, sorry } from "./layout";
import { goAlong, offerChoices } from "./live";
import { Stage } from "./scene/stage";
import { State } from "./state";

async function build(place: HTMLElement, source: Source, ownPage: boolean): Promise<App> {
  const manifest = await source.manifest(0);
  if (manifest.format !== 1) throw new Error("this page is of another version of SAND than its data; make it anew");
  if (!manifest.times.length) throw new Error("the run has no frames yet; look again when it has written one");
  const [series, grains] = await Promise.all([source.series(), source.grains()]);
  const page = layout(place);
  const known = { manifest, grains };
  const state = new State();
  const palettes = Object.keys(manifest.palettes).filter((p) => p !== "diverging");
  state.offer("palette", palettes.map((p) => [p, p]));
  offerChoices(state, known, series);
  state.setting("grain").to = manifest.grains - 1;
  // of a run that is still going, the newest frame is what one wants to see
  if (manifest.running) state.set("frame", manifest.times.length - 1);
  if (ownPage && location.hash.length > 1) state.fromAddress(location.hash);
  const stage = new Stage(page.canvas);
  const app = new App(source, state, stage, known, series, page, ownPage);
  await app.begin(state.get<string>("look"));
  if (ownPage) linkAddress(app);
  return app;
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
