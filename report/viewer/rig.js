// What does not move: cameras, boards, floor, axes.
import { AxesHelper, BufferAttribute, BufferGeometry, Color, DoubleSide, GridHelper, Group, LineBasicMaterial, LineSegments, LinearFilter, Mesh, MeshBasicMaterial, Quaternion, Texture, Vector3, VertexColors } from 'three/build/three.module.js';

const DEPTH = 0.13;  // of a frustum, as a share of the rig's extent; as in the drawn figures, and smaller for more than eight cameras

export const UP_AXES = { 1: [1, 0, 0], 2: [0, 1, 0], 3: [0, 0, 1] };
export const upOf = (scene) => new Vector3(...UP_AXES[Math.abs(scene.up || 3)]).multiplyScalar(Math.sign(scene.up || 3));

/** The middle of all cameras and of the people at the first time step (float64), and a radius around it. */
export function boundsOf(scene, people) {
  const points = scene.cameras.map((camera) => camera.at);
  for (let person = 0; people.frames.length > 0 && person < people.ids.length; ++person) {
    for (const step of [0, people.frames.length >> 1]) {
      for (let j = 0; j < people.joints.length; ++j) {
        const joint = people.joint(step, person, j);
        if (joint) points.push(Array.from(joint.at));
      }
    }
  }
  if (points.length < 2) for (const board of scene.boards || []) points.push(board.slice(0, 3));
  if (points.length === 0) return { centre: [0, 0, 0], radius: 1 };
  const low = [0, 1, 2].map((i) => Math.min(...points.map((p) => p[i]))), high = [0, 1, 2].map((i) => Math.max(...points.map((p) => p[i])));
  const radius = Math.hypot(...[0, 1, 2].map((i) => high[i] - low[i])) / 2;
  return { centre: [0, 1, 2].map((i) => (low[i] + high[i]) / 2), radius: radius > 1e-9 ? radius : 1 };
}

function lines(positions, material) {
  const geometry = new BufferGeometry();
  geometry.setAttribute('position', new BufferAttribute(new Float32Array(positions), 3));
  const object = new LineSegments(geometry, material);
  object.frustumCulled = false;
  return object;
}

/** A pixel at the frustum's end, in the world. */
function onFrustum(camera, centre, depth, u, v) {
  const [w, h] = camera.size, [, , cx, cy] = camera.lens, a = camera.axes;
  const x = depth * camera.half[0] * (u - (cx === null ? w / 2 : cx)) / (w / 2 || 1), y = depth * camera.half[1] * (v - (cy === null ? h / 2 : cy)) / (h / 2 || 1);
  return new Vector3(...[0, 1, 2].map((i) => camera.at[i] - centre[i] + x * a[i] + y * a[3 + i] + depth * a[6 + i]));
}

export class Rig {
  constructor(scene, bounds) {
    this.scene = scene;
    this.centre = bounds.centre;
    this.depth = DEPTH * 2 * bounds.radius * Math.min(1, Math.sqrt(8 / Math.max(1, scene.cameras.length)));
    this.group = new Group();
    this.images = new Group();
    this.boards = new Group();
    this.floor = new Group();
    this.group.add(this.images, this.boards, this.floor);
    this.addCameras();
    this.addBoards();
    this.addFloor(bounds.radius);
  }

  at(camera) { return new Vector3(...[0, 1, 2].map((i) => camera.at[i] - this.centre[i])); }

  addCameras() {
    const positions = [];
    this.middles = [];
    for (const camera of this.scene.cameras) {
      const [w, h] = camera.size[0] > 0 && camera.size[1] > 0 ? camera.size : (camera.size = [2, 2]), apex = this.at(camera);
      const corners = [[0, 0], [w, 0], [w, h], [0, h]].map(([u, v]) => onFrustum(camera, this.centre, this.depth, u, v));
      const add = (a, b) => positions.push(a.x, a.y, a.z, b.x, b.y, b.z);
      corners.forEach((corner, i) => { add(apex, corner); add(corner, corners[(i + 1) % 4]); });
      const tip = onFrustum(camera, this.centre, this.depth, w / 2, -h / 5);  // above the image
      add(onFrustum(camera, this.centre, this.depth, w * 0.35, 0), tip);
      add(tip, onFrustum(camera, this.centre, this.depth, w * 0.65, 0));
      this.middles.push(onFrustum(camera, this.centre, this.depth, w / 2, h / 2));
    }
    this.lines = lines(positions, new LineBasicMaterial({ vertexColors: VertexColors }));
    this.lines.geometry.setAttribute('color', new BufferAttribute(new Float32Array(positions.length), 3));
    this.group.add(this.lines);
  }

  /** An image of the page on its place in the frustum; `box`: left, top, width, height in px. */
  addImage(index, element, box) {
    const camera = this.scene.cameras[index], depth = this.depth * 0.995, [left, top, width, height] = box;
    const corners = [[left, top], [left + width, top], [left + width, top + height], [left, top + height]].map(([u, v]) => onFrustum(camera, this.centre, depth, u, v));
    const geometry = new BufferGeometry();
    geometry.setAttribute('position', new BufferAttribute(new Float32Array(corners.flatMap((c) => [c.x, c.y, c.z])), 3));
    geometry.setAttribute('uv', new BufferAttribute(new Float32Array([0, 1, 1, 1, 1, 0, 0, 0]), 2));
    geometry.setIndex([0, 3, 1, 1, 3, 2]);
    const texture = new Texture(element);
    texture.minFilter = LinearFilter;
    texture.generateMipmaps = false;
    texture.needsUpdate = true;
    this.images.add(new Mesh(geometry, new MeshBasicMaterial({ map: texture, side: DoubleSide })));
  }

  addBoards() {
    const positions = [], [width, height] = this.scene.board_size || [0, 0], size = this.depth / 4;
    for (const board of this.scene.boards || []) {
      const q = new Quaternion(...board.slice(3, 7)).normalize(), at = new Vector3(...[0, 1, 2].map((i) => board[i] - this.centre[i]));
      const place = (x, y, z) => new Vector3(x, y, z).applyQuaternion(q).add(at);
      const add = (a, b) => positions.push(a.x, a.y, a.z, b.x, b.y, b.z);
      const corners = width > 0 ? [place(0, 0, 0), place(width, 0, 0), place(width, height, 0), place(0, height, 0)] : [];
      corners.forEach((corner, i) => add(corner, corners[(i + 1) % 4]));
      add(at, place(0, 0, width > 0 ? width / 8 : size));
      if (width <= 0) { add(at, place(size, 0, 0)); add(at, place(0, size, 0)); }
    }
    this.boardLines = lines(positions, new LineBasicMaterial({ transparent: true, opacity: 0.55 }));
    this.boards.add(this.boardLines);
    this.boards.visible = (this.scene.frames || []).length === 0;
  }

  addFloor(radius) {
    const up = upOf(this.scene), axis = Math.abs(this.scene.up || 3) - 1;
    this.cell = 10 ** Math.round(Math.log10(radius / 3));
    const half = Math.min(20, Math.ceil(1.3 * radius / this.cell)), grid = new GridHelper(2 * half * this.cell, 2 * half);
    grid.quaternion.setFromUnitVectors(new Vector3(0, 1, 0), up);
    const place = this.centre.map((v) => Math.round(v / this.cell) * this.cell - v);
    place[axis] = Math.sign(this.scene.up || 3) * (this.scene.floor || 0) - this.centre[axis];
    grid.position.set(...place);
    this.grid = grid;
    this.floor.add(grid);
    const axes = new AxesHelper(this.cell), origin = new Vector3(...this.centre).negate();
    axes.position.copy(origin);
    axes.visible = origin.length() < 8 * radius;
    this.floor.add(axes);
  }

  colour(theme, chosen) {
    const colours = this.lines.geometry.getAttribute('color'), count = this.scene.cameras.length, each = count ? colours.count / count : 0;
    for (let i = 0; i < count; ++i) {
      const c = new Color(i === chosen ? theme.chosen : theme.camera);
      for (let k = 0; k < each; ++k) colours.setXYZ(i * each + k, c.r, c.g, c.b);
    }
    colours.needsUpdate = true;
    this.boardLines.material.color.set(theme.board);
    const grid = this.grid.geometry.getAttribute('color'), g = new Color(theme.grid);
    for (let k = 0; k < grid.count; ++k) grid.setXYZ(k, g.r, g.g, g.b);
    grid.needsUpdate = true;
  }
}
