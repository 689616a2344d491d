// Formatting of numbers with SI prefixes.

const PREFIXES = ["y", "z", "a", "f", "p", "n", "µ", "m", "", "k", "M", "G", "T", "P"];

/** Units written with a prefix; others, such as A m² and rad/s, get a power of ten. */
const PREFIXED = new Set(["m", "s", "J", "N", "m/s", "kg", "C", "T", "Pa"]);

/** A number with at most `count` digits: 0.001234, 1.234×10⁻⁷, −12.3; null stands for NaN, as in JSON. */
export function digits(value: number | null, count = 4): string {
  if (value === Infinity || value === -Infinity) return value > 0 ? "∞" : "−∞";
  if (value === null || !Number.isFinite(value)) return "not known";
  if (value === 0) return "0";
  const size = Math.abs(value);
  const plain = size >= 1e-3 && size < 1e6;
  const text = plain ? String(Number(value.toPrecision(count))) : scientific(value, count);
  return text.replace("-", "−");
}

function scientific(value: number, count: number): string {
  const [mantissa, exponent] = value.toExponential(count - 1).split("e");
  const raised = exponent.replace("+", "").replace("-", "⁻").replace(/\d/g, (c) => "⁰¹²³⁴⁵⁶⁷⁸⁹"[Number(c)]);
  return `${Number(mantissa)}×10${raised}`;
}

/** Factor and unit with the prefix for a magnitude: [1e-9, "nm"] for 3e-7 m. */
export function prefixed(size: number, unit: string): [number, string] {
  if (!(size > 0) || !Number.isFinite(size) || !PREFIXED.has(unit) || unit === "kg") return [1, unit];
  const step = Math.min(Math.max(Math.floor(Math.log10(size) / 3 + 1e-9), -8), 5);
  return [10 ** (3 * step), PREFIXES[step + 8] + unit];
}

/** A quantity with its unit: 1.2e-6 m → "1.2 µm". */
export function quantity(value: number, unit: string, count = 4): string {
  if (!Number.isFinite(value)) return digits(value);
  const [factor, name] = prefixed(Math.abs(value), unit);
  return `${digits(value / factor, count)}${name ? ` ${name}` : ""}`;
}
