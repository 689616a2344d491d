// Data from a source; README.md defines the meaning of every key.

export type Colour3 = [number, number, number];

export interface Field {
  text: string;
  direction?: number[];
  /** Flux density [T] at the first frame; of each frame, if it varies. */
  size?: number;
  sizes?: number[];
  directions?: number[][];
}

export interface Manifest {
  format: number;
  generation: number; // changes when the run is restarted
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
  /** Own quantities of the user that the grains have. */
  own: { id: string; label: string; unit: string }[];
  /** Whether frames have `at_rest`. */
  at_rest: boolean;
  periodic: boolean[];
  field: Field | null;
  ranges: Record<string, [number, number]>;
  /** Lower and upper percentile that are the range of these quantities. */
  percentiles: { limits: [number, number]; of: string[] };
  /** What the values of a contact are, by name. */
  hints: Record<string, string>;
  palettes: Record<string, Colour3[]>;
  colours: {
    big: string[];
    small: string[];
    single: string;
    modes: string[];
    within: string;
    materials: string[];
    rest: string[];
    named: Record<string, number>;
  };
  dimensions: Record<string, [number | null, number | null]>[] | null;
}

/** Constant properties of the grains; radius in the manifest's `unit`, all others in SI units. */
export interface Grains {
  radius: Float32Array;
  mass: Float32Array;
  material: Uint8Array;
}

/** The drawn box, and the displacement of its images along z, along x; absent where there is none. */
export interface Box {
  box: number[];
  tilt?: number;
}

/** One frame; positions and box in the manifest's `unit`, all others in SI units. */
export interface Frame extends Box {
  frame: number;
  step: number;
  time: number;
  position: Float32Array;
  velocity: Float32Array;
  spin: Float32Array;
  moment: Float32Array;
  cluster: Uint32Array;
  /** 1 for grains of clusters at rest, 0 for those of awake clusters; with rigid clusters. */
  at_rest?: Uint8Array;
  /** Absent if no grain is charged. */
  charge?: Float32Array;
  /** Mean pressure in each grain by its contacts [Pa], those with walls included; in runs with stress. */
  pressure?: Float32Array;
  /** Own quantities of the user, by their id in the manifest. */
  own: Map<string, Float32Array>;
  pair: Uint32Array;
  force: Float32Array;
  share: Float32Array;
  overlap: Float32Array;
  formed: Float32Array;
  bytes: number;
}

export interface Line {
  label: string;
  /** What it is, in a sentence, or "". */
  hint: string;
  light: string;
  dark: string;
  values: (number | null)[];
}

export interface Plot {
  id: string;
  title: string;
  unit: string;
  axis: "linear" | "log" | "symlog";
  /** Lower end of a logarithmic axis; magnitude below which a symmetric logarithmic one is linear. */
  least: number | null;
  lines: Line[];
}

export interface Series {
  time: number[];
  plots: Plot[];
  events: { time: number[]; made: number[]; broken: number[] };
}

export type Dimension = { value: number | null; error: number | null } | { reason: string };

/** The data source of a page: a server, blocks of its own file, or the kernel of a notebook. */
export interface Source {
  manifest(since: number): Promise<Manifest>;
  series(): Promise<Series>;
  grains(): Promise<Grains>;
  frame(k: number): Promise<Frame>;
  dimension(k: number, grain: number): Promise<Dimension>;
}

/** The cluster name of grains without a contact. */
export const SINGLE = 0xffffffff;
