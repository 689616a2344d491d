// A run that is still going: what has come since, and how it stands.

import type { App } from "./app";
import { type Known, QUANTITIES } from "./data/quantities";
import type { Manifest, Series } from "./data/types";
import type { State } from "./state";

/** Seconds between questions whether a run has gone on. */
const EVERY = 1;

/** What can be chosen with these data, which become more while a run goes on; names of the settings. */
export function offerChoices(state: State, known: Known, series: Series): string[] {
  const there = QUANTITIES.filter((q) => q.available?.(known) ?? true);
  state.offer("colour", there.map((q) => [q.id, q.label]));
  state.offer("plot", series.plots.map((p) => [p.id, p.title]));
  return ["colour", "plot"];
}

/** How the run stands, beside its name. */
export function tellRun({ manifest, page }: App): void {
  const counted = (count: number, what: string): string => `${count} ${what}${count === 1 ? "" : "s"}`;
  const parts = [counted(manifest.grains, "grain"), counted(manifest.times.length, "frame")];
  if (manifest.running) parts.push("still running");
  else if (manifest.outcome) parts.push(manifest.outcome);
  if (manifest.field) parts.push(manifest.field.text);
  if (manifest.note) parts.push(manifest.note);
  page.told.textContent = page.told.title = parts.join("  ·  ");
}

/** What has come since. */
function take(app: App, more: Manifest, series: Series): void {
  const { manifest, state, picture } = app;
  const atEnd = state.number("frame") >= manifest.times.length - 1;
  manifest.times.push(...more.times);
  manifest.steps.push(...more.steps);
  if (manifest.field && more.field?.directions) manifest.field.directions = more.field.directions;
  const { running, outcome, note, bytes, ranges } = more;
  Object.assign(manifest, { running, outcome, note, bytes, ranges });
  app.series = series;
  for (const id of offerChoices(state, app.known, series)) app.panel.refill(id);
  app.timeline.setFrames(manifest.times, series.events);
  app.showPlot();
  tellRun(app);
  const goesAlong = atEnd && state.get<boolean>("live") && !app.player.playing && !app.studio.busy;
  if (goesAlong) void app.go(Infinity);
  else if (picture.frame) app.timeline.show(picture.frame.frame, picture.frame.step);
  if (!goesAlong && !app.player.playing) app.redress(); // scales may have changed
}

/** Questions without an answer, one after another, after which none is asked any more. */
const GIVEN_UP = 5;

/** Ask again and again, while a run goes on. */
export async function goAlong(app: App): Promise<void> {
  let failed = 0;
  while (app.manifest.running) {
    await new Promise((on) => setTimeout(on, 1000 * EVERY));
    if (!app.page.root.isConnected) return;
    try {
      const more = await app.source.manifest(app.manifest.times.length);
      if (more.generation !== app.manifest.generation) {
        app.tell("This run was begun anew: load the page again to see it.");
        return;
      }
      const news = more.times.length || more.running !== app.manifest.running;
      if (news) take(app, more, await app.source.series());
      if (failed) app.tell("");
      failed = 0;
    } catch (error) {
      app.tell((error as Error).message);
      if (++failed === GIVEN_UP) return;
    }
  }
}
