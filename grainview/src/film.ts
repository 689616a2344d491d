// Frames of a film, which `sand view --movie` asks for one after another.

import type { Camera, CameraController } from "./camera";
import type { Exporter } from "./exporter";
import type { Picture } from "./picture";

export interface FilmContext {
  stage: Camera & { resize(width: number, height: number): void };
  camera: Pick<CameraController, "overview">;
  picture: Pick<Picture, "frame" | "complete">;
  exporter: Pick<Exporter, "image">;
  player: { stop(): void };
  navigation: { go(frame: number): Promise<void> };
}

/** Frames from which the view of all frames is found. */
const SAMPLED = 9;

export class Film {
  private size = { width: 1, height: 1 };

  constructor(private readonly context: FilmContext) {}

  /** Set the size of the pictures [pixels]; `aim`: choose a view that contains the grains of all frames, and the box. */
  async begin(width: number, height: number, count: number, aim: boolean): Promise<void> {
    const { stage, picture, player } = this.context;
    player.stop();
    this.size = { width, height };
    picture.complete = true;
    stage.resize(width, height);
    if (aim) stage.look = await this.viewOfAll(count);
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
    const { picture, exporter, navigation } = this.context;
    await navigation.go(k);
    if (picture.frame?.frame !== k) throw new Error(`frame ${k} cannot be shown`);
    const request = { ...this.size, kind: "png" as const, transparent: false, caption: true, from: k, to: k };
    const bytes = new Uint8Array(await (await exporter.image(request, true)).arrayBuffer());
    let text = "";
    for (let at = 0; at < bytes.length; at += 8192) text += String.fromCharCode(...bytes.subarray(at, at + 8192));
    return btoa(text);
  }
}
