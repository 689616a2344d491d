// The table of actions with their keys.

import type { Playback } from "./player";
import type { Action } from "./ui/keys";

export interface CameraActions {
  reset(): void;
  centre(): void;
  showCluster(cluster: Uint8Array | null): void;
  showBroadside(cluster: Uint8Array | null): void;
  lookAlong(from: [number, number, number], up: [number, number, number]): void;
  turn(sideways: number, upwards: number): void;
  pan(right: number, upwards: number): void;
  zoom(factor: number): void;
}

export interface SelectionActions {
  stepGrain(by: 1 | -1): void;
  stepContact(by: 1 | -1): void;
  selectLargestCluster(): void;
  largestCluster(): Uint8Array | null;
  cluster(): Uint8Array | null;
  measureFromSelected(): void;
  clear(): void;
}

export interface ExportActions {
  openDialog(kind: "png" | "webm"): void;
  saveImage(): Promise<void>;
  /** Stop saving frames; false if none were being saved. */
  stop(): boolean;
}

export interface PageActions {
  help(): void;
  togglePanel(): void;
  copyAddress: (() => void) | null; // null in a notebook, where the address is not that of the page
}

/** Everything that actions operate on. */
export interface Commands {
  playback: Playback;
  camera: CameraActions;
  selection: SelectionActions;
  exports: ExportActions;
  page: PageActions;
}

/** Views along the axes: name, direction from the target to the eye, up vector. */
const AXES: [string, [number, number, number], [number, number, number]][] = [
  ["x", [1, 0, 0], [0, 0, 1]],
  ["y", [0, -1, 0], [0, 0, 1]],
  ["z", [0, 0, 1], [0, 1, 0]],
];

const TURN = Math.PI / 24; // rad per key press
const PAN = 0.08; // heights of the view per key press
const ZOOM = 1.2;

export function actionsOf({ playback, camera, selection, exports, page }: Commands): Action[] {
  const step = (by: number) => (): void => playback.step(by);
  const turn = (sideways: number, upwards: number) => (): void => camera.turn(sideways * TURN, upwards * TURN);
  const pan = (right: number, upwards: number) => (): void => camera.pan(PAN * right, PAN * upwards);
  const { copyAddress } = page;
  return [
    { id: "help", label: "Keys and help", keys: ["?", "F1"], run: () => page.help() },
    { id: "play", label: "Play or pause", keys: [" "], run: () => playback.toggle() },
    { id: "next-frame", label: "Next frame", keys: ["ArrowRight"], run: step(1) },
    { id: "previous-frame", label: "Previous frame", keys: ["ArrowLeft"], run: step(-1) },
    { id: "forward-10", label: "Ten frames forward", keys: ["Shift+ArrowRight"], run: step(10) },
    { id: "back-10", label: "Ten frames back", keys: ["Shift+ArrowLeft"], run: step(-10) },
    { id: "first-frame", label: "First frame", keys: ["Home"], run: () => playback.go(0) },
    { id: "last-frame", label: "Last frame", keys: ["End"], run: () => playback.go(Infinity) },
    { id: "next-event", label: "Next event", keys: ["n"], run: () => playback.toEvent(1) },
    { id: "previous-event", label: "Previous event", keys: ["N"], run: () => playback.toEvent(-1) },
    { id: "next-grain", label: "Select the next grain", keys: ["."], run: () => selection.stepGrain(1) },
    { id: "previous-grain", label: "Select the previous grain", keys: [","], run: () => selection.stepGrain(-1) },
    { id: "next-contact", label: "Select the next contact", keys: ["k"], run: () => selection.stepContact(1) },
    { id: "previous-contact", label: "Select the previous contact", keys: ["K"],
      run: () => selection.stepContact(-1) },
    { id: "largest", label: "Select the largest cluster", keys: ["y"], run: () => selection.selectLargestCluster() },
    { id: "measure-from", label: "Measure from the selected grain", keys: ["e"],
      run: () => selection.measureFromSelected() },
    { id: "clear", label: "Clear selection; stop saving", keys: ["Escape"],
      run: () => void (exports.stop() || selection.clear()) },
    { id: "centre", label: "Centre the selection, or everything", keys: ["z"], run: () => camera.centre() },
    { id: "view-largest", label: "View the largest cluster", keys: ["Y"],
      run: () => camera.showCluster(selection.largestCluster()) },
    { id: "broadside", label: "View the selected or largest cluster broadside", keys: ["Z"],
      run: () => camera.showBroadside(selection.cluster() ?? selection.largestCluster()) },
    { id: "reset", label: "Reset the view", keys: ["r", "0"], run: () => camera.reset() },
    ...AXES.map(([name, from, up], k) => ({
      id: `along-${name}`, label: `View along ${name}`, keys: [String(k + 1)], run: () => camera.lookAlong(from, up),
    })),
    { id: "turn-left", label: "Turn left", keys: ["Ctrl+ArrowLeft"], run: turn(-1, 0) },
    { id: "turn-right", label: "Turn right", keys: ["Ctrl+ArrowRight"], run: turn(1, 0) },
    { id: "turn-up", label: "Turn up", keys: ["ArrowUp", "Ctrl+ArrowUp"], run: turn(0, 1) },
    { id: "turn-down", label: "Turn down", keys: ["ArrowDown", "Ctrl+ArrowDown"], run: turn(0, -1) },
    { id: "pan-left", label: "Pan left", keys: ["Ctrl+Shift+ArrowLeft"], run: pan(-1, 0) },
    { id: "pan-right", label: "Pan right", keys: ["Ctrl+Shift+ArrowRight"], run: pan(1, 0) },
    { id: "pan-up", label: "Pan up", keys: ["Ctrl+Shift+ArrowUp", "Shift+ArrowUp"], run: pan(0, 1) },
    { id: "pan-down", label: "Pan down", keys: ["Ctrl+Shift+ArrowDown", "Shift+ArrowDown"], run: pan(0, -1) },
    { id: "zoom-in", label: "Zoom in", keys: ["PageUp"], run: () => camera.zoom(1 / ZOOM) },
    { id: "zoom-out", label: "Zoom out", keys: ["PageDown"], run: () => camera.zoom(ZOOM) },
    { id: "picture", label: "Picture or movie", keys: ["s"], run: () => exports.openDialog("png") },
    { id: "movie", label: "Movie", keys: ["v"], run: () => exports.openDialog("webm") },
    { id: "save-now", label: "Save a picture without asking", keys: ["S"], run: () => void exports.saveImage() },
    ...(copyAddress
      ? [{ id: "link", label: "Copy the address of this view", keys: ["j"], run: copyAddress }]
      : []),
    { id: "panel", label: "Settings", keys: ["`"], run: () => page.togglePanel() },
  ];
}
