// The data source in a notebook: messages to the kernel and its replies.

import { decodeFrame, decodeGrains } from "./data/packet";
import type { Dimension, Frame, Grains, Manifest, Series, Source } from "./data/types";

/** The part of anywidget's model that is used. */
export interface Model {
  send(content: unknown): void;
  on(name: string, listener: (...args: never[]) => void): void;
  off(name: string, listener: (...args: never[]) => void): void;
}

interface Reply {
  id: number;
  error?: string | number; // a message, or the error of a dimension
  manifest?: Manifest;
  series?: Series;
}

export class WidgetSource implements Source {
  private nextId = 1;
  private readonly pending = new Map<number, (reply: Reply, data: DataView[]) => void>();
  private readonly listener = (reply: Reply, data: DataView[]): void => {
    this.pending.get(reply.id)?.(reply, data);
    this.pending.delete(reply.id);
  };

  constructor(private readonly model: Model) {
    model.on("msg:custom", this.listener as never);
  }

  close(): void {
    this.model.off("msg:custom", this.listener as never);
  }

  private request(kind: string, parameters: object = {}): Promise<[Reply, ArrayBuffer]> {
    const id = this.nextId++;
    return new Promise((resolve, reject) => {
      this.pending.set(id, (reply, data) => {
        if (typeof reply.error === "string") reject(new Error(reply.error));
        else resolve([reply, data[0] ? copyBuffer(data[0]) : new ArrayBuffer(0)]);
      });
      this.model.send({ id, kind, ...parameters });
    });
  }

  async manifest(since: number): Promise<Manifest> {
    return (await this.request("manifest", { since }))[0].manifest as Manifest;
  }

  async series(): Promise<Series> {
    return (await this.request("series"))[0].series as Series;
  }

  async grains(): Promise<Grains> {
    return decodeGrains((await this.request("grains"))[1]);
  }

  async frame(k: number): Promise<Frame> {
    return decodeFrame((await this.request("frame", { k }))[1]);
  }

  async dimension(k: number, grain: number): Promise<Dimension> {
    return (await this.request("dimension", { k, grain }))[0] as unknown as Dimension;
  }
}

/** Copy the bytes of a view, which may begin anywhere in a message, to an aligned buffer. */
function copyBuffer(view: DataView): ArrayBuffer {
  return view.buffer.slice(view.byteOffset, view.byteOffset + view.byteLength) as ArrayBuffer;
}
