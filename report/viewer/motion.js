// A fitted body over time, and Gaussians on it: the file that avatar/splats/files/player_file.h writes.

/** Time steps farther from those of the file than this many of their usual distances have no body. */
const REACH = 1.5;

export function readMotion(base64) {
  const text = atob(base64), bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; ++i) bytes[i] = text.charCodeAt(i);
  const head = new DataView(bytes.buffer), [gaussians, faces, vertices, steps] = [8, 12, 16, 20].map((at) => head.getUint32(at, true));
  const vector = (at) => [0, 4, 8].map((i) => head.getFloat32(at + i, true));
  let at = 64;
  const take = (Type, length) => { const array = new Type(bytes.buffer, at, length); at += array.byteLength; return array; };
  return {
    gaussians, faces, vertices, low: vector(28), high: vector(40), frames: take(Int32Array, steps), corner: take(Uint32Array, 3 * faces),
    face: take(Uint32Array, gaussians), mesh: take(Uint16Array, 3 * vertices * steps), place: take(Uint16Array, 2 * gaussians),
    offset: take(Uint16Array, gaussians), looks: take(Uint8Array, 11 * gaussians),
  };
}

/** Between which time steps of the file a frame lies: [first, second, share of the second]; null where none is near. */
export function between(frames, frame) {
  const gaps = Array.from(frames).slice(1).map((f, i) => f - frames[i]).sort((a, b) => a - b);
  const reach = REACH * Math.max(1, gaps.length > 0 ? gaps[gaps.length >> 1] : 1);
  let next = frames.findIndex((f) => f >= frame);
  if (next === 0 || frames[next] === frame) return frames[next] - frame <= reach ? [next, next, 0] : null;
  if (next < 0) return frame - frames[frames.length - 1] <= reach ? [frames.length - 1, frames.length - 1, 0] : null;
  const gap = frames[next] - frames[next - 1];
  return gap <= 2 * reach ? [next - 1, next, (frame - frames[next - 1]) / gap] : null;
}

/** Vertices (m, less `centre`) into `out`; whether there is a body at the frame. */
export function poseMesh(motion, frame, centre, out) {
  const found = between(motion.frames, frame), size = 3 * motion.vertices;
  if (!found) return false;
  const [first, second, share] = found, { mesh, low, high } = motion;
  for (let k = 0; k < size; ++k) {
    const axis = k % 3, steps = mesh[first * size + k] * (1 - share) + mesh[second * size + k] * share;
    out[k] = low[axis] + (high[axis] - low[axis]) * steps / 65535 - centre[axis];
  }
  return true;
}

/** Middles of the Gaussians on posed vertices into `out`. */
export function poseGaussians(motion, vertices, out) {
  for (let i = 0; i < motion.gaussians; ++i) {
    const [o, a, b] = [0, 1, 2].map((k) => 3 * motion.corner[3 * motion.face[i] + k]);
    const u = [0, 1, 2].map((k) => vertices[a + k] - vertices[o + k]), w = [0, 1, 2].map((k) => vertices[b + k] - vertices[o + k]);
    const n = [u[1] * w[2] - u[2] * w[1], u[2] * w[0] - u[0] * w[2], u[0] * w[1] - u[1] * w[0]], length = Math.hypot(...n) || 1;
    const p = motion.place[2 * i] / 65535 * 2 - 0.5, q = motion.place[2 * i + 1] / 65535 * 2 - 0.5, off = (motion.offset[i] / 65535 * 0.2 - 0.1) / length;
    for (let k = 0; k < 3; ++k) out[3 * i + k] = vertices[o + k] + p * u[k] + q * w[k] + off * n[k];
  }
}
