// What a source hands over; README.md says what everything means.

export type Colour3 = [number, number, number];

export interface Field {
  text: string;
  direction?: number[];
  directions?: number[][];
}

export interface Manifest {
  format: number;
  generation: number; // another one: the run was begun anew
  name: string;
  version: string;
  grains: number;
  times: number[];
  steps: number[];
  bytes: number;
  running: boolean;
  outcome: string | null;
  note: string | null;
  unit: number;
  materials: string[];
  periodic: boolean[];
  field: Field | null;
  ranges: Record<string, [number, number]>;
  palettes: Record<string, Colour3[]>;
  colours: {
    big: string[];
    small: string[];
    single: string;
    modes: string[];
    within: string;
    materials: string[];
    named: Record<string, number>;
  };
  dimensions: Record<string, [number | null, number | null]>[] | null;
}

/** Of the grains, what never changes; radius in units of the manifest's `unit`, the rest SI. */
export interface Grains {
  radius: Float32Array;
  mass: Float32Array;
  material: Uint8Array;
  charge: Float32Array;
}

/** One frame; positions, as lengths of the box, in the manifest's `unit`, everything else SI. */
export interface Frame {
  frame: number;
  step: number;
  time: number;
  box: number[];
  position: Float32Array;
  velocity: Float32Array;
  spin: Float32Array;
  moment: Float32Array;
  cluster: Uint32Array;
  pair: Uint32Array;
  force: Float32Array;
  share: Float32Array;
  overlap: Float32Array;
  formed: Float32Array;
  bytes: number;
}

export interface Line {
  label: string;
  light: string;
  dark: string;
  values: (number | null)[];
}

export interface Plot {
  id: string;
  title: string;
  unit: string;
  log: boolean;
  lines: Line[];
}

export interface Series {
  time: number[];
  plots: Plot[];
  events: { time: number[]; made: number[]; broken: number[] };
}

export type Dimension = { value: number | null; error: number | null } | { reason: string };

/** Where a page has its data from: a server, blocks of its own file, or a notebook's kernel. */
export interface Source {
  manifest(since: number): Promise<Manifest>;
  series(): Promise<Series>;
  grains(): Promise<Grains>;
  frame(k: number): Promise<Frame>;
  dimension(k: number, grain: number): Promise<Dimension>;
}

/** The name of grains without a contact. */
export const SINGLE = 0xffffffff;
