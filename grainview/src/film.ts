// Frames of a film, which `sand view --movie` asks for one after another.

import type { Camera, CameraController } from "./camera";
import type { Exporter } from "./exporter";
import type { Picture } from "./picture";
import { lookFromText } from "./scene/look";
import type { State } from "./state";

export interface FilmContext {
  stage: Camera & { resize(width: number, height: number): void };
  camera: Pick<CameraController, "overview">;
  picture: Pick<Picture, "frame" | "complete">;
  exporter: Pick<Exporter, "image">;
  player: { stop(): void };
  navigation: { go(frame: number): Promise<void> };
  note: { readonly message: string };
  state: State;
}

export interface FilmRequest {
  width: number; // pixels
  height: number;
  count: number; // frames
  settings: string; // as in the address; without a `look` the view contains the grains of all frames, and the box
}

/** Frames from which the view of all frames is found. */
const SAMPLED = 9;

/** What is wrong with settings that were given as text: their names, or values that they did not take. */
function wrongSettings(text: string, state: State): string[] {
  return [...new URLSearchParams(text)].flatMap(([name, value]) => {
    const setting = state.settings.find((s) => s.id === name);
    if (!setting) {
      const names = state.settings.map((s) => s.id).join(", ");
      return [`--settings ${name}: there is no such setting; the page has ${names}`];
    }
    const taken = state.get(name);
    const same = typeof taken === "boolean" ? value === String(Number(taken))
      : typeof taken === "number" ? value !== "" && Number(value) === taken : value === taken;
    if (same) return [];
    const { options, from, to } = setting;
    const range = from === undefined ? "" : to === undefined ? `at least ${from}` : `from ${from} to ${to}`;
    const allowed = options ? options.map(([v]) => v).join(", ") : typeof taken === "boolean" ? "0, 1" : range;
    return [`--settings ${name}=${value} is not possible${allowed && `; allowed: ${allowed}`}`];
  });
}

export class Film {
  private size = { width: 1, height: 1 };

  constructor(private readonly context: FilmContext) {}

  /** Set size, settings and view of the pictures; returns what is wrong with the settings. */
  async begin({ width, height, count, settings }: FilmRequest): Promise<string[]> {
    const { stage, picture, player, navigation, state } = this.context;
    player.stop();
    this.size = { width, height };
    state.fromAddress(settings);
    const wrong = wrongSettings(settings, state);
    if (wrong.length) return wrong;
    const look = lookFromText(state.get("look"));
    picture.complete = true;
    stage.resize(width, height);
    await navigation.go(0);
    stage.look = look ?? (await this.viewOfAll(count));
    return [];
  }

  /** The smallest view that surely contains the overviews of sampled frames, of which each has a target of its own. */
  private async viewOfAll(count: number): Promise<Camera["look"]> {
    const { camera, navigation } = this.context;
    const looks: Camera["look"][] = [];
    const samples = Math.min(SAMPLED, count);
    for (let s = 0; s < samples; s++) {
      await navigation.go(Math.round((s * (count - 1)) / Math.max(samples - 1, 1)));
      looks.push(camera.overview());
    }
    const middle = (a: number): number => {
      const values = looks.map((look) => look.target[a]);
      return (Math.min(...values) + Math.max(...values)) / 2;
    };
    const target: Camera["look"]["target"] = [middle(0), middle(1), middle(2)];
    const apart = (look: Camera["look"]): number => Math.hypot(...look.target.map((x, a) => x - target[a]));
    return { ...looks[0], target, height: Math.max(...looks.map((look) => look.height + 2 * apart(look))) };
  }

  /** A frame as a PNG, in base64. */
  async picture(k: number): Promise<string> {
    const { picture, exporter, navigation, note } = this.context;
    await navigation.go(k);
    if (picture.frame?.frame !== k) throw new Error(note.message || `frame ${k} cannot be shown`);
    const request = { ...this.size, kind: "png" as const, transparent: false, caption: true, from: k, to: k };
    const bytes = new Uint8Array(await (await exporter.image(request, true)).arrayBuffer());
    let text = "";
    for (let at = 0; at < bytes.length; at += 8192) text += String.fromCharCode(...bytes.subarray(at, at + 8192));
    return btoa(text);
  }
}
