// Decoding of packets: a header and arrays, see README.md.

import type { Frame, Grains } from "./types";

const MAGIC = "SANDPKT1";

/** Beginning of the names of own quantities. */
const OWN = "own/";

interface Entry {
  name: string;
  type: "f4" | "f2" | "u4" | "u1";
  shape: number[];
  offset: number;
  scale?: number;
}

type Numbers = Float32Array | Uint32Array | Uint8Array;

let halves: Float32Array | null = null;

/** All half-precision numbers, by their bits; older browsers have no Float16Array. */
function halfTable(): Float32Array {
  if (halves) return halves;
  halves = new Float32Array(65536);
  for (let bits = 0; bits < 65536; bits++) {
    const exponent = (bits >> 10) & 31;
    const fraction = bits & 1023;
    let size = 2 ** (exponent - 15) * (1 + fraction / 1024);
    if (exponent === 0) size = 2 ** -14 * (fraction / 1024);
    if (exponent === 31) size = fraction ? NaN : Infinity;
    halves[bits] = bits & 0x8000 ? -size : size;
  }
  return halves;
}

function decodeHalf(bits: Uint16Array, scale: number): Float32Array {
  const table = halfTable();
  const out = new Float32Array(bits.length);
  for (let i = 0; i < bits.length; i++) out[i] = table[bits[i]] * scale;
  return out;
}

function decodeArray(buffer: ArrayBuffer, begin: number, entry: Entry): Numbers {
  const count = entry.shape.reduce((a, b) => a * b, 1);
  if (entry.type === "u4") return new Uint32Array(buffer, begin, count);
  if (entry.type === "u1") return new Uint8Array(buffer, begin, count);
  const scale = entry.scale ?? 1;
  if (entry.type === "f2") return decodeHalf(new Uint16Array(buffer, begin, count), scale);
  const values = new Float32Array(buffer, begin, count);
  return scale === 1 ? values : values.map((v) => v * scale);
}

/** Header, and arrays by name. */
function decode(buffer: ArrayBuffer): { header: Record<string, unknown>; arrays: Record<string, Numbers> } {
  const magic = new TextDecoder().decode(new Uint8Array(buffer, 0, Math.min(8, buffer.byteLength)));
  if (magic !== MAGIC) throw new Error("not a packet of SAND: the file may be cut off, or written by another version");
  const length = new DataView(buffer).getUint32(8, true);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 12, length)));
  const arrays: Record<string, Numbers> = {};
  for (const entry of header.arrays as Entry[]) {
    try {
      arrays[entry.name] = decodeArray(buffer, 12 + length + entry.offset, entry);
    } catch {
      throw new Error(`a packet is cut off in its array “${entry.name}”; export the page again`);
    }
  }
  return { header, arrays };
}

export function decodeGrains(buffer: ArrayBuffer): Grains {
  return decode(buffer).arrays as unknown as Grains;
}

export function decodeFrame(buffer: ArrayBuffer): Frame {
  const { header, arrays } = decode(buffer);
  // decoding of half precision allocates new arrays, in addition to the buffer
  const bytes = new Set(Object.values(arrays).map((a) => a.buffer)).size === 1
    ? buffer.byteLength
    : Object.values(arrays).reduce((sum, a) => sum + a.byteLength, 0) + buffer.byteLength;
  const own = new Map<string, Numbers>();
  for (const [name, array] of Object.entries(arrays)) {
    if (name.startsWith(OWN)) own.set(name.slice(OWN.length), array);
  }
  return { ...(header as object), ...arrays, own, bytes } as unknown as Frame;
}
