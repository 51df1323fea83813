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

// One column: its byte planes put together, and steps added up.
function column({ bytes, n, delta }, raw, start) {
  const planes = delta ? bytes + 1 : bytes;
  const values = new KINDS[bytes](n);
  let last = 0;
  for (let i = 0; i < n; i++) {
    let value = 0;
    for (let p = planes - 1; p >= 0; p--) value = value * 256 + raw[start + p * n + i];
    if (delta) {
      last += value % 2 ? -(value + 1) / 2 : value / 2;
      value = last;
    }
    values[i] = value;
  }
  return { values, next: start + planes * n };
}

// Returns a map of arrays; those of several columns are lists of columns.
export async function unpack(text, entries) {
  const raw = await inflated(bytesOf(text.trim()));
  const arrays = new Map();
  let start = 0;
  for (const entry of entries) {
    const columns = [];
    for (let c = 0; c < entry.columns; c++) {
      const { values, next } = column(entry, raw, start);
      columns.push(values);
      start = next;
    }
    arrays.set(entry.name, columns);
  }
  return arrays;
}

const step = (value) => (value % 2 ? -(value + 1) / 2 : value / 2);

// Corners of all faces of a mesh, one after the other: 16-bit places in its box.
export function corners(arrays, name) {
  const [x, y, z] = arrays.get(`${name}.places`);
  const [first] = arrays.get(`${name}.first`);
  const [second, third] = arrays.get(`${name}.others`);
  const places = new Uint16Array(9 * first.length);
  for (let f = 0, k = 0; f < first.length; f++) {
    const a = first[f];
    for (const v of [a, a + step(second[f]), a + step(third[f])]) {
      places[k++] = x[v];
      places[k++] = y[v];
      places[k++] = z[v];
    }
  }
  return places;
}

export function half(bits) {
  const exponent = (bits >> 10) & 31;
  const part = bits & 1023;
  const sign = bits >> 15 ? -1 : 1;
  if (exponent === 31) return sign * Infinity;
  return sign * (exponent ? 2 ** (exponent - 15) * (1 + part / 1024) : (2 ** -14 * part) / 1024);
}
