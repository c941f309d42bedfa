#include "report/page/player.h"

namespace mvstudio::report {
namespace {

// Reads the file that avatar/splats/files/player_file.h writes, moves the Gaussians with their triangles, sorts them by depth
// and draws each as a square with its covariance in the image (Zwicker et al., "EWA Splatting", TVCG 2002), from back to front.
constexpr char kScript[] = R"js('use strict';
(function () {
  const VERTEX = `#version 300 es
  precision highp float;
  uniform mat4 view; uniform vec2 size; uniform float focal; uniform float mip;
  in vec2 corner; in vec3 middle; in vec3 spread; in vec3 shear; in vec4 look;
  out vec2 at; out vec4 ink;
  void main() {
    vec3 p = (view * vec4(middle, 1.0)).xyz;
    gl_Position = vec4(2.0, 2.0, 2.0, 1.0); at = vec2(0.0); ink = vec4(0.0);
    if (p.z < 0.05) return;
    mat3 world = mat3(spread.x, shear.x, shear.y, shear.x, spread.y, shear.z, shear.y, shear.z, spread.z);
    mat3 turn = mat3(view);
    mat3 cam = turn * world * transpose(turn);
    vec3 jx = vec3(focal / p.z, 0.0, -focal * p.x / (p.z * p.z)), jy = vec3(0.0, focal / p.z, -focal * p.y / (p.z * p.z));
    float a = dot(jx, cam * jx), b = dot(jx, cam * jy), c = dot(jy, cam * jy);
    float area = max(a * c - b * b, 0.0), low = mip > 0.5 ? 0.1 : 0.3;
    a += low; c += low;
    float filtered = a * c - b * b;
    float alpha = look.a * (mip > 0.5 ? sqrt(area / filtered) : 1.0);
    if (alpha < 1.0 / 255.0) return;
    float half_sum = 0.5 * (a + c), root = sqrt(max(0.25 * (a - c) * (a - c) + b * b, 0.0));
    float major = half_sum + root, minor = max(half_sum - root, 0.01);
    vec2 axis = abs(b) > 1e-6 ? normalize(vec2(b, major - a)) : (a >= c ? vec2(1.0, 0.0) : vec2(0.0, 1.0));
    float reach = sqrt(2.0 * log(255.0 * alpha));
    vec2 px = reach * (corner.x * sqrt(major) * axis + corner.y * sqrt(minor) * vec2(-axis.y, axis.x));
    vec2 centre = focal * p.xy / p.z;
    gl_Position = vec4(2.0 * (centre + px) / size * vec2(1.0, -1.0), 0.0, 1.0);
    at = reach * corner; ink = vec4(look.rgb, alpha);
  }`;
  const FRAGMENT = `#version 300 es
  precision highp float;
  in vec2 at; in vec4 ink; out vec4 colour;
  void main() {
    float alpha = min(0.99, ink.a * exp(-0.5 * dot(at, at)));
    if (alpha < 1.0 / 255.0) discard;
    colour = vec4(ink.rgb * alpha, alpha);
  }`;

  function bytesOf(uri) {
    const text = atob(uri.slice(uri.indexOf(',') + 1)), bytes = new Uint8Array(text.length);
    for (let i = 0; i < text.length; ++i) bytes[i] = text.charCodeAt(i);
    return bytes.buffer;
  }

  function read(buffer) {
    const head = new DataView(buffer), count = function (k) { return head.getUint32(8 + 4 * k, true); };
    const vector = function (k) { return [0, 1, 2].map(function (i) { return head.getFloat32(28 + 12 * k + 4 * i, true); }); };
    const f = {n: count(0), faces: count(1), vertices: count(2), instants: count(3), mip: count(4),
               low: vector(0), high: vector(1), up: vector(2)};
    let at = 64;
    const take = function (Type, length) {
      const array = new Type(buffer, at, length);
      at += array.byteLength;
      return array;
    };
    f.frames = take(Int32Array, f.instants);
    f.corner = take(Uint32Array, 3 * f.faces);
    f.face = take(Uint32Array, f.n);
    f.mesh = take(Uint16Array, 3 * f.vertices * f.instants);
    f.place = take(Uint16Array, 2 * f.n);
    f.offset = take(Uint16Array, f.n);
    f.looks = take(Uint8Array, 11 * f.n);
    return f;
  }

  // Covariance of each Gaussian in its triangle's frame, and its place there: what does not change.
  function prepare(f) {
    f.still = new Float32Array(9 * f.n);
    for (let i = 0; i < f.n; ++i) {
      const l = 11 * i, s = [0, 1, 2].map(function (k) { return Math.exp(2 * (10 * f.looks[l + k] / 255 - 10)); });
      let q = [3, 4, 5, 6].map(function (k) { return f.looks[l + k] / 127.5 - 1; });
      const norm = Math.hypot(q[0], q[1], q[2], q[3]) || 1, x = q[0] / norm, y = q[1] / norm, z = q[2] / norm, w = q[3] / norm;
      const r = [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w), 2 * (x * y + z * w), 1 - 2 * (x * x + z * z),
                 2 * (y * z - x * w), 2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)];
      const entry = function (a, b) { return s[0] * r[3 * a] * r[3 * b] + s[1] * r[3 * a + 1] * r[3 * b + 1] + s[2] * r[3 * a + 2] * r[3 * b + 2]; };
      f.still.set([entry(0, 0), entry(1, 1), entry(2, 2), entry(0, 1), entry(0, 2), entry(1, 2),
                   f.place[2 * i] / 65535 * 2 - 0.5, f.place[2 * i + 1] / 65535 * 2 - 0.5, f.offset[i] / 65535 * 0.2 - 0.1], 9 * i);
    }
    f.posed = new Float32Array(3 * f.vertices);
    f.frame = new Float32Array(12 * f.faces);
    f.moved = new Float32Array(9 * f.n);
    f.drawn = new Float32Array(13 * f.n);
    f.depth = new Float32Array(f.n);
    f.order = new Uint32Array(f.n);
  }

  // The mesh between two instants, its triangles' frames, and the Gaussians on them.
  function pose(f, time) {
    const first = Math.min(Math.floor(time), f.instants - 1), next = Math.min(first + 1, f.instants - 1), part = time - first;
    const size = 3 * f.vertices, m = f.mesh, v = f.posed;
    for (let k = 0; k < size; ++k) {
      const axis = k % 3, q = m[first * size + k] * (1 - part) + m[next * size + k] * part;
      v[k] = f.low[axis] + (f.high[axis] - f.low[axis]) * q / 65535;
    }
    const t = f.frame;
    for (let i = 0; i < f.faces; ++i) {
      const o = 3 * f.corner[3 * i], a = 3 * f.corner[3 * i + 1], b = 3 * f.corner[3 * i + 2], k = 12 * i;
      const ux = v[a] - v[o], uy = v[a + 1] - v[o + 1], uz = v[a + 2] - v[o + 2];
      const wx = v[b] - v[o], wy = v[b + 1] - v[o + 1], wz = v[b + 2] - v[o + 2];
      let nx = uy * wz - uz * wy, ny = uz * wx - ux * wz, nz = ux * wy - uy * wx;
      const area = Math.hypot(nx, ny, nz), length = Math.hypot(ux, uy, uz);
      if (!(area > 1e-12)) { t[k] = NaN; continue; }
      nx /= area; ny /= area; nz /= area;
      const ex = ux / length, ey = uy / length, ez = uz / length;
      t[k] = ex; t[k + 1] = ey; t[k + 2] = ez;
      t[k + 3] = ny * ez - nz * ey; t[k + 4] = nz * ex - nx * ez; t[k + 5] = nx * ey - ny * ex;
      t[k + 6] = nx; t[k + 7] = ny; t[k + 8] = nz;
    }
    const g = f.moved, s = f.still;
    for (let i = 0; i < f.n; ++i) {
      const c = 3 * f.face[i], o = 3 * f.corner[c], a = 3 * f.corner[c + 1], b = 3 * f.corner[c + 2], k = 12 * f.face[i], j = 9 * i;
      const p = s[j + 6], q = s[j + 7], h = s[j + 8], r = 1 - p - q;
      for (let x = 0; x < 3; ++x) g[j + x] = r * v[o + x] + p * v[a + x] + q * v[b + x] + h * t[k + 6 + x];
      const e = [0, 0, 0, 0, 0, 0];
      for (let x = 0; x < 3; ++x) {
        const tx = t[k + x], ty = t[k + 3 + x], tz = t[k + 6 + x];
        const cx = s[j] * tx + s[j + 3] * ty + s[j + 4] * tz, cy = s[j + 3] * tx + s[j + 1] * ty + s[j + 5] * tz,
              cz = s[j + 4] * tx + s[j + 5] * ty + s[j + 2] * tz;
        e[x] = cx * tx + cy * ty + cz * tz;
        if (x < 2) e[3 + x] = cx * t[k + 1 + x] + cy * t[k + 4 + x] + cz * t[k + 7 + x];
        if (x === 0) e[5] = cx * t[k + 2] + cy * t[k + 5] + cz * t[k + 8];
      }
      g[j + 3] = e[0]; g[j + 4] = e[1]; g[j + 5] = e[2]; g[j + 6] = e[3]; g[j + 7] = e[5]; g[j + 8] = e[4];
    }
  }

  // From back to front, by counting 4096 depths.
  function sort(f, view) {
    let least = Infinity, most = -Infinity;
    for (let i = 0; i < f.n; ++i) {
      const z = view[2] * f.moved[9 * i] + view[6] * f.moved[9 * i + 1] + view[10] * f.moved[9 * i + 2] + view[14];
      f.depth[i] = z;
      if (z < least) least = z;
      if (z > most) most = z;
    }
    const bins = 4096, starts = new Uint32Array(bins + 1), scale = (bins - 1) / Math.max(most - least, 1e-6);
    const bin = function (i) { return f.depth[i] >= least ? bins - 1 - Math.floor((f.depth[i] - least) * scale) : bins - 1; };
    for (let i = 0; i < f.n; ++i) ++starts[bin(i) + 1];
    for (let k = 0; k < bins; ++k) starts[k + 1] += starts[k];
    for (let i = 0; i < f.n; ++i) f.order[starts[bin(i)]++] = i;
    for (let k = 0; k < f.n; ++k) {
      const i = f.order[k], to = 13 * k;
      for (let x = 0; x < 9; ++x) f.drawn[to + x] = f.moved[9 * i + x];
      for (let x = 0; x < 3; ++x) f.drawn[to + 9 + x] = f.looks[11 * i + 8 + x] / 255;
      f.drawn[to + 12] = f.looks[11 * i + 7] / 255;
    }
  }

  function program(gl) {
    const made = gl.createProgram();
    for (const [type, source] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
      const shader = gl.createShader(type);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
      gl.attachShader(made, shader);
    }
    gl.linkProgram(made);
    if (!gl.getProgramParameter(made, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(made));
    return made;
  }

  // Camera on a sphere around the body: column-major cam_from_world with x right, y down, z forward.
  function viewOf(f, turn, tilt, distance) {
    const up = f.up, other = Math.abs(up[0]) < 0.9 ? [1, 0, 0] : [0, 1, 0];
    const cross = function (a, b) { return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]; };
    const unit = function (a) { const n = Math.hypot(a[0], a[1], a[2]) || 1; return [a[0] / n, a[1] / n, a[2] / n]; };
    const side = unit(cross(up, other)), front = cross(side, up);
    const c = Math.cos(tilt), s = Math.sin(tilt);
    const forward = [0, 1, 2].map(function (k) { return -(c * (Math.cos(turn) * front[k] + Math.sin(turn) * side[k]) + s * up[k]); });
    const right = unit(cross(forward, up)), down = cross(forward, right);
    const middle = [0, 1, 2].map(function (k) { return (f.low[k] + f.high[k]) / 2 - distance * forward[k]; });
    const rows = [right, down, forward], view = new Float32Array(16);
    for (let r = 0; r < 3; ++r) {
      for (let k = 0; k < 3; ++k) view[4 * k + r] = rows[r][k];
      view[12 + r] = -(rows[r][0] * middle[0] + rows[r][1] * middle[1] + rows[r][2] * middle[2]);
    }
    view[15] = 1;
    return view;
  }

  function start(box) {
    const canvas = box.querySelector('canvas'), slider = box.querySelector('input'), button = box.querySelector('button'),
          label = box.querySelector('output');
    const gl = canvas.getContext('webgl2', {premultipliedAlpha: true, antialias: false, preserveDrawingBuffer: true});
    if (!gl) { label.textContent = 'this browser has no WebGL 2'; return; }
    const f = read(bytesOf(box.dataset.file));
    prepare(f);
    const made = program(gl), uniform = function (name) { return gl.getUniformLocation(made, name); };
    gl.useProgram(made);
    const corners = gl.createBuffer(), attribute = function (name) { return gl.getAttribLocation(made, name); };
    gl.bindBuffer(gl.ARRAY_BUFFER, corners);
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array([-1, -1, 1, -1, -1, 1, 1, 1]), gl.STATIC_DRAW);
    gl.enableVertexAttribArray(attribute('corner'));
    gl.vertexAttribPointer(attribute('corner'), 2, gl.FLOAT, false, 0, 0);
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    for (const [name, size, offset] of [['middle', 3, 0], ['spread', 3, 3], ['shear', 3, 6], ['look', 4, 9]]) {
      gl.enableVertexAttribArray(attribute(name));
      gl.vertexAttribPointer(attribute(name), size, gl.FLOAT, false, 52, 4 * offset);
      gl.vertexAttribDivisor(attribute(name), 1);
    }
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    const diagonal = Math.hypot(f.high[0] - f.low[0], f.high[1] - f.low[1], f.high[2] - f.low[2]);
    const state = {time: 0, turn: 0.6, tilt: 0.1, distance: 1.25 * diagonal, playing: false, last: 0};
    slider.max = String(f.instants - 1);
    function draw() {
      const ratio = window.devicePixelRatio || 1, width = Math.round(canvas.clientWidth * ratio), height = Math.round(canvas.clientHeight * ratio);
      if (canvas.width !== width || canvas.height !== height) { canvas.width = width; canvas.height = height; }
      const view = viewOf(f, state.turn, state.tilt, state.distance);
      pose(f, state.time);
      sort(f, view);
      gl.viewport(0, 0, width, height);
      gl.clearColor(0, 0, 0, 1);
      gl.clear(gl.COLOR_BUFFER_BIT);
      gl.uniformMatrix4fv(uniform('view'), false, view);
      gl.uniform2f(uniform('size'), width, height);
      gl.uniform1f(uniform('focal'), 1.5 * Math.min(width, height));
      gl.uniform1f(uniform('mip'), f.mip);
      gl.bufferData(gl.ARRAY_BUFFER, f.drawn, gl.STREAM_DRAW);
      gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, f.n);
      label.textContent = 'frame ' + f.frames[Math.round(state.time)];
      slider.value = String(Math.round(state.time));
    }
    // Frames of the dataset count 30 a second; a pause between two instants is at most half a second.
    function step(now) {
      if (!state.playing) return;
      const at = Math.min(Math.floor(state.time), f.instants - 2), gap = Math.min(Math.max(f.frames[at + 1] - f.frames[at], 1), 15);
      state.time += Math.min(now - state.last, 200) / 1000 * 30 / gap;
      if (state.time >= f.instants - 1) state.time = 0;
      state.last = now;
      draw();
      requestAnimationFrame(step);
    }
    function play(on) {
      state.playing = on && f.instants > 1;
      button.textContent = state.playing ? 'Pause' : 'Play';
      state.last = performance.now();
      if (state.playing) requestAnimationFrame(step);
    }
    button.addEventListener('click', function () { play(!state.playing); });
    slider.addEventListener('input', function () { play(false); state.time = Number(slider.value); draw(); });
    canvas.addEventListener('pointermove', function (event) {
      if (event.buttons !== 1) return;
      state.turn -= event.movementX * 0.01;
      state.tilt = Math.min(1.5, Math.max(-1.5, state.tilt + event.movementY * 0.01));
      draw();
    });
    canvas.addEventListener('wheel', function (event) {
      event.preventDefault();
      state.distance = Math.min(8 * diagonal, Math.max(0.3 * diagonal, state.distance * Math.exp(event.deltaY * 0.001)));
      draw();
    }, {passive: false});
    new ResizeObserver(draw).observe(canvas);  // also when it is unfolded
    draw();
  }
  for (const box of document.querySelectorAll('.player')) {
    try { start(box); } catch (error) { box.querySelector('output').textContent = 'cannot be shown: ' + error.message; }
  }
})();
)js";

}  // namespace

std::string_view PlayerScript() { return kScript; }

}  // namespace mvstudio::report
