// A fitted body over time, and Gaussians on it: the files body_motion.bin and player.bin of docs/formats.md.

const FAR = 12;  // frames between two meshes of a player, beyond which nothing is known of those between

function open(base64) {
  const text = atob(base64), bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; ++i) bytes[i] = text.charCodeAt(i);
  const head = new DataView(bytes.buffer);
  let at = 0;
  return {
    skip: (count) => { at += count; },
    counts: (count) => Array.from({ length: count }, () => { at += 4; return head.getUint32(at - 4, true); }),
    vector: () => [0, 1, 2].map(() => { at += 4; return head.getFloat32(at - 4, true); }),
    take: (Type, length) => { const array = new Type(bytes.buffer, at, length); at += array.byteLength; return array; },
  };
}

export function readBody(base64) {
  const file = open(base64);
  file.skip(8);
  const [vertices, faces, bones, steps] = file.counts(4), low = file.vector(), high = file.vector();
  const body = { vertices, faces, bones, frames: file.take(Int32Array, steps), corner: file.take(Uint32Array, 3 * faces), shift: file.take(Float32Array, 3 * bones * steps), turn: file.take(Int16Array, 4 * bones * steps) };
  const rest = file.take(Uint16Array, 3 * vertices);
  body.rest = Float32Array.from(rest, (v, k) => low[k % 3] + (high[k % 3] - low[k % 3]) * v / 65535);
  const gaps = Array.from(body.frames.slice(1), (frame, i) => frame - body.frames[i]).sort((a, b) => a - b);
  body.gap = 2 * (gaps[gaps.length >> 1] || 1);  // a longer one is of frames without a pose
  return Object.assign(body, { bone: file.take(Uint8Array, 4 * vertices), weight: file.take(Uint8Array, 4 * vertices) });
}

/** The body's colours: corners with their vertex and place in an image, which comes as an address. */
export function readTexture(base64) {
  const file = open(base64);
  file.skip(8);
  const [corners, faces, bytes] = file.counts(3);
  const vertex = file.take(Uint32Array, corners), uv = Float32Array.from(file.take(Uint16Array, 2 * corners), (v) => v / 65535);
  const corner = file.take(Uint32Array, 3 * faces), image = file.take(Uint8Array, bytes);
  let text = '';
  for (let i = 0; i < bytes; ++i) text += String.fromCharCode(image[i]);
  return { vertex, uv, corner, address: 'data:image/' + (image[0] === 0x89 ? 'png' : 'jpeg') + ';base64,' + btoa(text) };
}

export function readPlayer(base64) {
  const file = open(base64);
  file.skip(8);
  const [gaussians, faces, vertices, steps] = file.counts(5), low = file.vector(), high = file.vector();
  file.skip(12);
  return {
    gaussians, faces, vertices, low, high, frames: file.take(Int32Array, steps), corner: file.take(Uint32Array, 3 * faces), face: file.take(Uint32Array, gaussians), mesh: file.take(Uint16Array, 3 * vertices * steps),
    place: file.take(Uint16Array, 2 * gaussians), offset: file.take(Uint16Array, gaussians), looks: file.take(Uint8Array, 11 * gaussians),
  };
}

/** Between which time steps of ascending frames one lies: [first, second, share of the second]; null outside of them. */
function between(frames, frame) {
  const next = frames.findIndex((f) => f >= frame);
  if (next < 0 || (next === 0 && frames[0] !== frame)) return null;
  if (frames[next] === frame) return [next, next, 0];
  return [next - 1, next, (frame - frames[next - 1]) / (frames[next] - frames[next - 1])];
}

/** x, y, z of the rotation's and the shift's rows: world_from_body of each bone, 12 numbers each. */
function transforms(body, step) {
  const out = new Float32Array(12 * body.bones);
  for (let b = 0; b < body.bones; ++b) {
    const k = step * body.bones + b, [x, y, z, w] = [0, 1, 2, 3].map((i) => body.turn[4 * k + i] / 32767);
    out.set([1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w), body.shift[3 * k], 2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w), body.shift[3 * k + 1], 2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y), body.shift[3 * k + 2]], 12 * b);
  }
  return out;
}

/** Linear blend skinning (m, less `centre`) into `out`; whether there is a body at the frame. Of thinned frames the nearer one. */
export function poseBody(body, frame, centre, out) {
  const found = between(body.frames, frame);
  if (!found || body.frames[found[1]] - body.frames[found[0]] > body.gap) return false;
  const matrices = transforms(body, found[2] < 0.5 ? found[0] : found[1]), { rest, bone, weight } = body;
  for (let v = 0; v < body.vertices; ++v) {
    const [x, y, z] = [rest[3 * v], rest[3 * v + 1], rest[3 * v + 2]], at = [0, 0, 0];
    let sum = 0;
    for (let k = 4 * v; k < 4 * v + 4; ++k) {
      const w = weight[k], m = 12 * bone[k];
      if (w === 0) continue;
      sum += w;
      for (let i = 0; i < 3; ++i) at[i] += w * (matrices[m + 4 * i] * x + matrices[m + 4 * i + 1] * y + matrices[m + 4 * i + 2] * z + matrices[m + 4 * i + 3]);
    }
    for (let i = 0; i < 3; ++i) out[3 * v + i] = at[i] / sum - centre[i];
  }
  return true;
}

/** The same of a player's meshes. */
export function posePlayer(player, frame, centre, out) {
  const found = between(player.frames, frame), size = 3 * player.vertices;
  if (!found || player.frames[found[1]] - player.frames[found[0]] > FAR) return false;
  const [first, second, share] = found, { mesh, low, high } = player;
  for (let k = 0; k < size; ++k) {
    const axis = k % 3, steps = mesh[first * size + k] * (1 - share) + mesh[second * size + k] * share;
    out[k] = low[axis] + (high[axis] - low[axis]) * steps / 65535 - centre[axis];
  }
  return true;
}

/** Middles of the Gaussians on posed vertices into `out`. */
export function poseGaussians(player, vertices, out) {
  for (let i = 0; i < player.gaussians; ++i) {
    const [o, a, b] = [0, 1, 2].map((k) => 3 * player.corner[3 * player.face[i] + k]);
    const u = [0, 1, 2].map((k) => vertices[a + k] - vertices[o + k]), w = [0, 1, 2].map((k) => vertices[b + k] - vertices[o + k]);
    const n = [u[1] * w[2] - u[2] * w[1], u[2] * w[0] - u[0] * w[2], u[0] * w[1] - u[1] * w[0]], length = Math.hypot(...n) || 1;
    const p = player.place[2 * i] / 65535 * 2 - 0.5, q = player.place[2 * i + 1] / 65535 * 2 - 0.5, off = (player.offset[i] / 65535 * 0.2 - 0.1) / length;
    for (let k = 0; k < 3; ++k) out[3 * i + k] = vertices[o + k] + p * u[k] + q * w[k] + off * n[k];
  }
}
