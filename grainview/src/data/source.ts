// Sources: the loopback server, and the blocks of a single file.  The notebook's is in widget.ts.

import { decodeFrame, decodeGrains } from "./packet";
import type { Dimension, Frame, Grains, Manifest, Series, Source } from "./types";

/** Asks the server that the page came from. */
export class ServerSource implements Source {
  private async get(address: string): Promise<Response> {
    let answer: Response;
    try {
      answer = await fetch(address, { cache: "no-store" });
    } catch {
      throw new Error("the server does not answer: `sand view` has ended; start it again and open the new address");
    }
    if (answer.ok) return answer;
    const told = await answer.json().catch(() => ({}));
    throw new Error(told.error ?? `the server answers ${answer.status}`);
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

const damaged = (name: string): Error => new Error(`this file is damaged in its part “${name}”; ask for it again`);

/** Reads the blocks that `sand view --html` has put into the page itself. */
export class EmbeddedSource implements Source {
  private told: Manifest | null = null;

  static isThere(): boolean {
    return document.querySelector('script[id^="sand-"]') !== null;
  }

  private text(name: string): string {
    const block = document.getElementById(`sand-${name}`);
    if (!block?.textContent) throw new Error(`this file is cut off: “${name}” is missing; ask for it again`);
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
      throw new Error("This browser is too old for this page: it cannot unpack it (DecompressionStream is missing).");
    }
    try {
      const packed = Uint8Array.from(atob(text.trim()), (c) => c.charCodeAt(0));
      const plain = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
      return await new Response(plain).arrayBuffer();
    } catch {
      throw damaged(name);
    }
  }

  async manifest(): Promise<Manifest> {
    this.told ??= this.json<Manifest>("manifest");
    return this.told;
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
    const known = this.told?.dimensions?.[k]?.[String(name)];
    if (known) return { value: known[0], error: known[1] };
    return { reason: "not in this file: only clusters of 32 grains and more have one, the largest of each frame" };
  }
}
