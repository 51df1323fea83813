// Undoes what planning/report/page/payload.py did: base64, deflate, byte planes, steps.

const KINDS = { 1: Uint8Array, 2: Uint16Array, 4: Uint32Array };

function bytesOf(text) {
  if (Uint8Array.fromBase64) return Uint8Array.fromBase64(text);
  const binary = atob(text);
  const bytes = new Uint8Array(binary.length);
  for (let i = 0; i < bytes.length; i++) bytes[i] = binary.charCodeAt(i);
  return bytes;
}

async function inflated(bytes) {
  const stream = new Blob([bytes]).stream();
  const open = stream.pipeThrough(new DecompressionStream("deflate-raw"));
  return new Uint8Array(await new Response(open).arrayBuffer());
}

// One column: its byte planes put together, and steps added up. Without either it is
// the bytes themselves.
function column({ bytes, n, delta }, raw, start) {
  if (bytes === 1 && !delta) return raw.subarray(start, start + n);
  const planes = delta ? bytes + 1 : bytes;
  const whole = bytes === 4 ? new Float64Array(n) : new Uint32Array(n);
  for (let p = 0; p < planes; p++) {
    const [scale, from] = [256 ** p, start + p * n];
    for (let i = 0; i < n; i++) if (raw[from + i]) whole[i] += raw[from + i] * scale;
  }
  const values = new KINDS[bytes](n);
  let last = 0;
  for (let i = 0; i < n; i++) {
    const value = whole[i];
    if (!delta) values[i] = value;
    else values[i] = last += value % 2 ? -(value + 1) / 2 : value / 2;
  }
  return values;
}

// The arrays of a page by their names: lists of columns, each undone when first asked for.
class Arrays {
  constructor(raw, entries) {
    this.raw = raw;
    this.known = new Map();
    this.entries = new Map();
    let start = 0;
    for (const entry of entries) {
      const length = entry.n * (entry.delta ? entry.bytes + 1 : entry.bytes);
      this.entries.set(entry.name, { ...entry, start, length });
      start += entry.columns * length;
    }
  }

  get(name) {
    if (!this.known.has(name)) {
      const entry = this.entries.get(name);
      const at = Array.from({ length: entry.columns }, (_, c) => entry.start + c * entry.length);
      this.known.set(name, at.map((start) => column(entry, this.raw, start)));
    }
    return this.known.get(name);
  }
}

export async function unpack(text, entries) {
  return new Arrays(await inflated(bytesOf(text.trim())), entries);
}

const step = (value) => (value % 2 ? -(value + 1) / 2 : value / 2);

// A mesh: 16-bit places of its vertices in its box, and the three vertices of each face.
export function meshOf(arrays, name) {
  const places = arrays.get(`${name}.places`);
  const [first] = arrays.get(`${name}.first`);
  const faces = [first, ...arrays.get(`${name}.others`).map((column) => new Uint32Array(column.length))];
  arrays.get(`${name}.others`).forEach((column, k) => {
    for (let f = 0; f < first.length; f++) faces[k + 1][f] = first[f] + step(column[f]);
  });
  return { places, faces };
}

export function half(bits) {
  const exponent = (bits >> 10) & 31;
  const part = bits & 1023;
  const sign = bits >> 15 ? -1 : 1;
  if (exponent === 31) return sign * Infinity;
  return sign * (exponent ? 2 ** (exponent - 15) * (1 + part / 1024) : (2 ** -14 * part) / 1024);
}
