// Chunks of people over time; the layout is that of report/scene/scene.h.

export const sigmaOf = (code) => (code === 0 ? NaN : 1e-6 * 2 ** ((code - 1) / 8));
export const residualOf = (code) => (code === 0 ? NaN : 0.01 * 2 ** ((code - 1) / 12));

const KEPT_CHUNKS = 6;

function bytesOf(base64) {
  const text = atob(base64);
  const bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; ++i) bytes[i] = text.charCodeAt(i);
  return bytes;
}

export function decodeChunk(base64) {
  const bytes = bytesOf(base64), data = new DataView(bytes.buffer);
  const [first, count, people, joints] = [0, 4, 8, 12].map((at) => data.getUint32(at, true));
  const records = count * joints, chunk = { first, count, joints, at: new Float64Array(3 * people * records), codes: new Uint8Array(8 * people * records) };
  let from = 16 + 40 * people, to = 0;
  for (let person = 0; person < people; ++person) {
    const head = 16 + 40 * person;
    const origin = [0, 8, 16].map((at) => data.getFloat64(head + at, true));
    const step = data.getFloat64(head + 24, true), width = data.getUint32(head + 32, true), none = width === 2 ? 0xffff : 0xffffffff;
    for (let i = 0; i < records; ++i, ++to) {
      for (let axis = 0; axis < 3; ++axis, from += width) {
        const steps = width === 2 ? data.getUint16(from, true) : data.getUint32(from, true);
        chunk.at[3 * to + axis] = steps === none ? NaN : origin[axis] + steps * step;
      }
      for (let k = 0; k < 8; ++k) chunk.codes[8 * to + k] = bytes[from++];
    }
  }
  return chunk;
}

/** Lower triangle of the covariance's Cholesky factor (m): maps the unit sphere to the ellipsoid of one sigma. */
export function factorOf(sigma, correlation) {
  const [sx, sy, sz] = sigma, [xy, xz, yz] = correlation;
  const a = xy * sy, b = Math.sqrt(Math.max(0, sy * sy - a * a)), c = xz * sz;
  const d = b > 0 ? (yz * sy * sz - a * c) / b : 0, limited = Math.max(-sz, Math.min(sz, d));
  return [sx, a, b, c, limited, Math.sqrt(Math.max(0, sz * sz - c * c - limited * limited))];
}

export class People {
  constructor(scene, elements) {
    this.frames = scene.frames || [];
    this.joints = scene.joints || [];
    this.bones = scene.bones || [];
    this.ids = scene.people || [];
    this.spans = scene.spans || [];
    this.rate = scene.rate_hz || 30;
    this.length = scene.chunk || 1;
    this.elements = elements;
    this.kept = new Map();
  }

  /** The chunk of a time step, decoded when it is first shown. */
  chunkOf(step) {
    const index = Math.floor(step / this.length);
    let chunk = this.kept.get(index);
    if (!chunk) {
      chunk = decodeChunk(this.elements[index].getAttribute('data-chunk'));
      if (this.kept.size >= KEPT_CHUNKS) this.kept.delete(this.kept.keys().next().value);
      this.kept.set(index, chunk);
    }
    return chunk;
  }

  /** Position (m, or null), sigmas (m), correlations, views and residual (px) of a joint. */
  joint(step, person, joint) {
    const chunk = this.chunkOf(step), record = (person * chunk.count + step - chunk.first) * chunk.joints + joint;
    const at = chunk.at.subarray(3 * record, 3 * record + 3), codes = chunk.codes.subarray(8 * record, 8 * record + 8);
    if (Number.isNaN(at[0])) return null;
    const signed = (code) => (code > 127 ? code - 256 : code) / 127;
    return { at, sigma: [0, 1, 2].map((i) => sigmaOf(codes[i])), correlation: [3, 4, 5].map((i) => signed(codes[i])), views: codes[6], residual: residualOf(codes[7]) };
  }

  /** The time step whose frame is nearest. */
  stepOf(frame) {
    let low = 0, high = this.frames.length - 1;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.frames[middle] < frame) low = middle + 1; else high = middle;
    }
    return low > 0 && frame - this.frames[low - 1] < this.frames[low] - frame ? low - 1 : Math.max(0, low);
  }
}
