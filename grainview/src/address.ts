// The state in the address of the page: a view can be shared, and is there again after a reload.

import type { App } from "./app";
import type { Look, Stage } from "./scene/stage";

/** The camera as text: target, direction, up, height; six digits each. */
export function lookText(stage: Stage): string {
  const { target, from, up, height } = stage.look;
  return [...target, ...from, ...up, height].map((v) => Number(v.toPrecision(6))).join(",");
}

/** The camera that a text tells of; null if it is none. */
function lookOf(text: string): Look | null {
  const v = text.split(",").map(Number);
  if (v.length !== 10 || !v.every((x) => Math.abs(x) < 1e9) || !(v[9] > 1e-6)) return null;
  const [target, from, up] = [0, 3, 6].map((k) => v.slice(k, k + 3) as [number, number, number]);
  const across = [0, 1, 2].map((a) => from[(a + 1) % 3] * up[(a + 2) % 3] - from[(a + 2) % 3] * up[(a + 1) % 3]);
  // from above the eye does not know what is up; looking along an axis does so, a little aside
  const aside = Math.hypot(...across) > 1e-6 * Math.hypot(...from) * Math.hypot(...up);
  return aside ? { target, from, up, height: v[9] } : null;
}

/** Look as a text says; false if it does not. */
export function lookAs(stage: Stage, text: string): boolean {
  const look = lookOf(text);
  if (look) stage.look = look;
  return look !== null;
}

/** Keep the address true; take what somebody writes into it. */
export function linkAddress(app: App): void {
  const { state } = app;
  let later = 0;
  let written = location.hash.slice(1);
  const write = (): void => {
    window.clearTimeout(later);
    later = 0;
    written = state.toAddress();
    history.replaceState(null, "", written ? `#${written}` : location.pathname + location.search);
  };
  app.beforeCopying = write;
  state.onChange(() => {
    if (!later) later = window.setTimeout(write, 250);
  });
  window.addEventListener("hashchange", () => {
    const text = location.hash.slice(1);
    if (text !== written) void app.takeAddress(text);
  });
}

/** The address onto the clipboard, if the browser allows it. */
export async function copyAddress(app: App): Promise<void> {
  app.beforeCopying();
  try {
    await navigator.clipboard.writeText(location.href);
    app.tellBriefly("The address of this view is on the clipboard.");
  } catch {
    app.tellBriefly("The browser does not let this page copy; take the address from its bar.");
  }
}
