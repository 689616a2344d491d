// A running simulation: the page polls its source for new frames.

import { type Dataset, quantitiesOf } from "./data/quantities";
import type { Manifest, Series, Source } from "./data/types";

/** Seconds between two polls. */
const INTERVAL = 1;

/** Consecutive failures after which polling ends. */
const MAX_FAILURES = 5;

/** The page, as polling needs it. */
export interface LiveRun {
  readonly manifest: Manifest;
  /** The page; it is not connected once it has been removed from its document. */
  readonly page: { readonly root: { readonly isConnected: boolean } };
  /** Add the frames of a partial manifest, and replace the series. */
  append(more: Manifest, series: Series): void;
  notify(message: string): void;
}

/** Settings whose options depend on the data. */
export interface DataChoices {
  offer(id: string, options: [value: string, label: string][]): void;
}

/** Set the options that these data allow, which increase while a run continues; returns the names of these settings. */
export function offerChoices(settings: DataChoices, dataset: Dataset, series: Series): string[] {
  const available = quantitiesOf(dataset.manifest).filter((q) => q.available?.(dataset) ?? true);
  settings.offer("colour", available.map((q) => [q.id, q.label]));
  settings.offer("plot", series.plots.map((p) => [p.id, p.title]));
  return ["colour", "plot"];
}

/** The line beside the name of the run: grains, frames, outcome, field, note. */
export function runStatus(manifest: Manifest): string {
  const counted = (count: number, noun: string): string => `${count} ${noun}${count === 1 ? "" : "s"}`;
  const parts = [counted(manifest.grains, "grain"), counted(manifest.times.length, "frame")];
  if (manifest.running) parts.push("still running");
  else if (manifest.outcome) parts.push(manifest.outcome);
  if (manifest.field) parts.push(manifest.field.text);
  if (manifest.note) parts.push(manifest.note);
  return parts.join("  ·  ");
}

/** Add the frames of a partial manifest to a manifest. */
export function appendFrames(manifest: Manifest, more: Manifest): void {
  manifest.times.push(...more.times);
  manifest.steps.push(...more.steps);
  if (manifest.field && more.field) Object.assign(manifest.field, more.field);
  const { running, outcome, note, bytes, ranges } = more;
  Object.assign(manifest, { running, outcome, note, bytes, ranges });
}

/** Poll until the run has ended. */
export async function pollRun(run: LiveRun, source: Pick<Source, "manifest" | "series">): Promise<void> {
  let failures = 0;
  while (run.manifest.running) {
    await new Promise((resolve) => setTimeout(resolve, 1000 * INTERVAL));
    if (!run.page.root.isConnected) return;
    try {
      const more = await source.manifest(run.manifest.times.length);
      if (more.generation !== run.manifest.generation) {
        run.notify("The run was restarted: reload the page to see it.");
        return;
      }
      const changed = more.times.length || more.running !== run.manifest.running;
      if (changed) run.append(more, await source.series());
      if (failures) run.notify("");
      failures = 0;
    } catch (error) {
      run.notify((error as Error).message);
      if (++failures === MAX_FAILURES) return;
    }
  }
}
