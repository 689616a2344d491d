// The state in the address of the page: a view can be shared, and is there again after a reload.

import type { Stage } from "./scene/stage";
import type { State } from "./state";

/** The camera as text: target, direction, up, height; five digits each. */
export function lookText(stage: Stage): string {
  const { target, from, up, height } = stage.look;
  return [...target, ...from, ...up, height].map((v) => Number(v.toPrecision(5))).join(",");
}

/** Look as a text says; nothing happens if it is none. */
export function lookAs(stage: Stage, text: string): void {
  const v = text.split(",").map(Number);
  if (v.length !== 10 || v.some((x) => !Number.isFinite(x)) || !(v[9] > 0)) return;
  const three = (k: number): [number, number, number] => [v[k], v[k + 1], v[k + 2]];
  stage.look = { target: three(0), from: three(3), up: three(6), height: v[9] };
}

/** Keep the address true; take what somebody writes into it. */
export function linkAddress(state: State, stage: Stage): void {
  let later = 0;
  let written = location.hash.slice(1);
  const write = (): void => {
    later = 0;
    written = state.toAddress();
    history.replaceState(null, "", written ? `#${written}` : location.pathname + location.search);
  };
  state.onChange(() => {
    if (!later) later = window.setTimeout(write, 250);
  });
  window.addEventListener("hashchange", () => {
    const text = location.hash.slice(1);
    if (text === written) return;
    state.fromAddress(text);
    lookAs(stage, state.get("look"));
  });
}
