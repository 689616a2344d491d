// The source in a notebook: questions to the kernel and its answers.

import { decodeFrame, decodeGrains } from "./data/packet";
import type { Dimension, Frame, Grains, Manifest, Series, Source } from "./data/types";

/** What anywidget gives of its model. */
export interface Model {
  send(content: unknown): void;
  on(name: string, listener: (...told: never[]) => void): void;
  off(name: string, listener: (...told: never[]) => void): void;
}

interface Answer {
  id: number;
  error?: string | number; // a sentence, or that of a dimension
  manifest?: Manifest;
  series?: Series;
}

export class WidgetSource implements Source {
  private next = 1;
  private readonly waiting = new Map<number, (answer: Answer, data: DataView[]) => void>();
  private readonly listener = (answer: Answer, data: DataView[]): void => {
    this.waiting.get(answer.id)?.(answer, data);
    this.waiting.delete(answer.id);
  };

  constructor(private readonly model: Model) {
    model.on("msg:custom", this.listener as never);
  }

  close(): void {
    this.model.off("msg:custom", this.listener as never);
  }

  private ask(kind: string, more: object = {}): Promise<[Answer, ArrayBuffer]> {
    const id = this.next++;
    return new Promise((give, fail) => {
      this.waiting.set(id, (answer, data) => {
        if (typeof answer.error === "string") fail(new Error(answer.error));
        else give([answer, data[0] ? copied(data[0]) : new ArrayBuffer(0)]);
      });
      this.model.send({ id, kind, ...more });
    });
  }

  async manifest(since: number): Promise<Manifest> {
    return (await this.ask("manifest", { since }))[0].manifest as Manifest;
  }

  async series(): Promise<Series> {
    return (await this.ask("series"))[0].series as Series;
  }

  async grains(): Promise<Grains> {
    return decodeGrains((await this.ask("grains"))[1]);
  }

  async frame(k: number): Promise<Frame> {
    return decodeFrame((await this.ask("frame", { k }))[1]);
  }

  async dimension(k: number, grain: number): Promise<Dimension> {
    return (await this.ask("dimension", { k, grain }))[0] as unknown as Dimension;
  }
}

/** A buffer of its own, aligned, whatever message the data came in. */
function copied(view: DataView): ArrayBuffer {
  return view.buffer.slice(view.byteOffset, view.byteOffset + view.byteLength) as ArrayBuffer;
}
