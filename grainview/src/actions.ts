// What can be done, each with its keys.

import { copyAddress } from "./address";
import type { App } from "./app";
import type { Action } from "./ui/keys";

/** Views along axes: from where, and what is up. */
const ALONG: [string, [number, number, number], [number, number, number]][] = [
  ["x", [1, 0, 0], [0, 0, 1]],
  ["y", [0, -1, 0], [0, 0, 1]],
  ["z", [0, 0, 1], [0, 1, 0]],
];

const TURN = Math.PI / 24;

export function actionsOf(app: App): Action[] {
  const { state, player } = app;
  const step = (by: number): void => void app.go(state.number("frame") + by);
  const turn = (across: number, up: number) => (): void => app.views.turn(across * TURN, up * TURN);
  const shift = (x: number, y: number) => (): void => app.views.pan(0.08 * x, 0.08 * y);
  return [
    { id: "help", label: "Keys and help", keys: ["?", "F1"], run: () => app.help() },
    { id: "play", label: "Play or pause", keys: [" "], run: () => player.toggle() },
    { id: "on", label: "One frame on", keys: ["ArrowRight"], run: () => step(1) },
    { id: "back", label: "One frame back", keys: ["ArrowLeft"], run: () => step(-1) },
    { id: "far-on", label: "Ten frames on", keys: ["Shift+ArrowRight"], run: () => step(10) },
    { id: "far-back", label: "Ten frames back", keys: ["Shift+ArrowLeft"], run: () => step(-10) },
    { id: "first", label: "First frame", keys: ["Home"], run: () => void app.go(0) },
    { id: "last", label: "Last frame", keys: ["End"], run: () => void app.go(Infinity) },
    { id: "next-event", label: "Next event", keys: ["n"], run: () => app.toEvent(1) },
    { id: "last-event", label: "Event before", keys: ["N"], run: () => app.toEvent(-1) },
    { id: "next-grain", label: "Choose the next grain", keys: ["."], run: () => app.choosing.step(1) },
    { id: "last-grain", label: "Choose the grain before", keys: [","], run: () => app.choosing.step(-1) },
    { id: "next-contact", label: "Choose the next contact", keys: ["k"], run: () => app.choosing.stepContact(1) },
    { id: "last-contact", label: "Choose the contact before", keys: ["K"], run: () => app.choosing.stepContact(-1) },
    { id: "largest", label: "Choose the largest cluster", keys: ["y"], run: () => app.choosing.chooseLargest() },
    { id: "end", label: "Measure from the chosen grain", keys: ["e"], run: () => app.choosing.measureFromChosen() },
    {
      id: "clear", label: "Choose nothing; stop saving", keys: ["Escape"],
      run: () => void (app.studio.stop() || app.choosing.clear()),
    },
    { id: "centre", label: "Centre on what is chosen, or on all", keys: ["z"], run: () => app.views.centre() },
    { id: "reset", label: "All in sight", keys: ["r", "0"], run: () => app.views.reset() },
    ...ALONG.map(([name, from, up], k) => ({
      id: `along-${name}`, label: `Look along ${name}`, keys: [String(k + 1)],
      run: () => void (app.stage.look = { ...app.stage.look, from, up }),
    })),
    { id: "left", label: "Turn left", keys: ["Ctrl+ArrowLeft"], run: turn(-1, 0) },
    { id: "right", label: "Turn right", keys: ["Ctrl+ArrowRight"], run: turn(1, 0) },
    { id: "up", label: "Turn up", keys: ["ArrowUp", "Ctrl+ArrowUp"], run: turn(0, 1) },
    { id: "down", label: "Turn down", keys: ["ArrowDown", "Ctrl+ArrowDown"], run: turn(0, -1) },
    { id: "pan-left", label: "Move left", keys: ["Ctrl+Shift+ArrowLeft"], run: shift(-1, 0) },
    { id: "pan-right", label: "Move right", keys: ["Ctrl+Shift+ArrowRight"], run: shift(1, 0) },
    { id: "pan-up", label: "Move up", keys: ["Ctrl+Shift+ArrowUp", "Shift+ArrowUp"], run: shift(0, 1) },
    { id: "pan-down", label: "Move down", keys: ["Ctrl+Shift+ArrowDown", "Shift+ArrowDown"], run: shift(0, -1) },
    { id: "nearer", label: "Nearer", keys: ["PageUp"], run: () => app.views.zoom(1 / 1.2) },
    { id: "farther", label: "Farther", keys: ["PageDown"], run: () => app.views.zoom(1.2) },
    { id: "picture", label: "Picture or movie", keys: ["s"], run: () => app.studio.ask("png") },
    { id: "movie", label: "Movie", keys: ["v"], run: () => app.studio.ask("webm") },
    { id: "quick", label: "Picture at once", keys: ["S"], run: () => void app.studio.quick() },
    { id: "link", label: "Copy the address of this view", keys: ["j"], run: () => void copyAddress(app) },
    { id: "panel", label: "Settings", keys: ["`"], run: () => app.togglePanel() },
  ];
}
