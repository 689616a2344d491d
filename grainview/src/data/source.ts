// Data sources: the loopback server, and the blocks of a single file. For that of a notebook see widget.ts.

import { decodeFrame, decodeGrains } from "./packet";
import type { Dimension, Frame, Grains, Manifest, Series, Source } from "./types";

/** Loads the data from the server of the page. */
export class ServerSource implements Source {
  private async get(address: string): Promise<Response> {
    let response: Response;
    try {
      response = await fetch(address, { cache: "no-store" });
    } catch {
      throw new Error("the server does not respond: `sand view` has ended; start it again and open the new address");
    }
    if (response.ok) return response;
    const content = await response.json().catch(() => ({}));
    throw new Error(content.error ?? `the server replied with status ${response.status}`);
  }

  async manifest(since: number): Promise<Manifest> {
    return (await this.get(`manifest?since=${since}`)).json();
  }

  async series(): Promise<Series> {
    return (await this.get("series")).json();
  }

  async grains(): Promise<Grains> {
    return decodeGrains(await (await this.get("grains")).arrayBuffer());
  }

  async frame(k: number): Promise<Frame> {
    return decodeFrame(await (await this.get(`frame/${k}`)).arrayBuffer());
  }

  async dimension(k: number, grain: number): Promise<Dimension> {
    return (await this.get(`dimension/${k}/${grain}`)).json();
  }
}

const damaged = (name: string): Error => new Error(`this file is damaged in its block “${name}”; export it again`);

/** Reads the blocks that `sand view --html` writes into the page. */
export class EmbeddedSource implements Source {
  private parsed: Manifest | null = null;

  static isPresent(): boolean {
    return document.querySelector('script[id^="sand-"]') !== null;
  }

  private text(name: string): string {
    const block = document.getElementById(`sand-${name}`);
    if (!block?.textContent) throw new Error(`this file is cut off: its block “${name}” is missing; export it again`);
    return block.textContent;
  }

  private json<T>(name: string): T {
    try {
      return JSON.parse(this.text(name));
    } catch (error) {
      if (error instanceof SyntaxError) throw damaged(name);
      throw error;
    }
  }

  private async packet(name: string): Promise<ArrayBuffer> {
    const text = this.text(name);
    if (typeof DecompressionStream === "undefined") {
      throw new Error("this browser is too old for this page: it has no DecompressionStream");
    }
    try {
      const compressed = Uint8Array.from(atob(text.trim()), (c) => c.charCodeAt(0));
      const stream = new Blob([compressed]).stream().pipeThrough(new DecompressionStream("gzip"));
      return await new Response(stream).arrayBuffer();
    } catch {
      throw damaged(name);
    }
  }

  async manifest(): Promise<Manifest> {
    this.parsed ??= this.json<Manifest>("manifest");
    return this.parsed;
  }

  async series(): Promise<Series> {
    return this.json<Series>("series");
  }

  async grains(): Promise<Grains> {
    return decodeGrains(await this.packet("grains"));
  }

  async frame(k: number): Promise<Frame> {
    return decodeFrame(await this.packet(`frame-${k}`));
  }

  async dimension(k: number, grain: number): Promise<Dimension> {
    const name = (await this.frame(k)).cluster[grain];
    const stored = this.parsed?.dimensions?.[k]?.[String(name)];
    if (stored) return { value: stored[0], error: stored[1] };
    return { reason: "not in this file: only the largest clusters of each frame, with 32 grains and more, have one" };
  }
}
