// The fitted body of one time step, and its Gaussians as points.
import { BufferAttribute, BufferGeometry, DoubleSide, Group, Mesh, MeshPhongMaterial, Points, PointsMaterial, VertexColors } from 'three/build/three.module.js';
import { poseGaussians, poseMesh, readMotion } from './motion.js';

const LEAST_OPACITY = 90;  // of 255: fainter Gaussians are no points

/** The bytes of the page's body: of its own element, else of the player of Gaussians; or nothing. */
function bytesOf(root) {
  const own = root.querySelector('[data-body]'), player = document.querySelector('.player[data-file]');
  if (own) return own.getAttribute('data-body');
  return player ? player.dataset.file.slice(player.dataset.file.indexOf(',') + 1) : null;
}

export class BodyView {
  constructor(root, bounds) {
    this.group = new Group();
    this.centre = bounds.centre;
    const bytes = bytesOf(root);
    if (!bytes) return;
    this.motion = readMotion(bytes);
    const shape = new BufferGeometry();
    this.vertices = new BufferAttribute(new Float32Array(3 * this.motion.vertices), 3);
    shape.setAttribute('position', this.vertices);
    shape.setIndex(new BufferAttribute(this.motion.corner, 1));
    this.material = new MeshPhongMaterial({ flatShading: true, side: DoubleSide, shininess: 0, transparent: true, opacity: 0.55, polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1 });
    this.mesh = new Mesh(shape, this.material);
    this.mesh.frustumCulled = false;
    this.group.add(this.mesh);
    if (this.motion.gaussians > 0) this.addPoints();
  }

  addPoints() {
    const { gaussians, looks } = this.motion, colours = new Float32Array(3 * gaussians);
    for (let i = 0; i < gaussians; ++i) for (let k = 0; k < 3; ++k) colours[3 * i + k] = looks[11 * i + 8 + k] / 255;
    const solid = [];
    for (let i = 0; i < gaussians; ++i) if (looks[11 * i + 7] >= LEAST_OPACITY) solid.push(i);
    const shape = new BufferGeometry();
    this.middles = new BufferAttribute(new Float32Array(3 * gaussians), 3);
    shape.setAttribute('position', this.middles);
    shape.setAttribute('color', new BufferAttribute(colours, 3));
    shape.setIndex(solid);
    this.points = new Points(shape, new PointsMaterial({ size: 0.012, vertexColors: VertexColors }));
    this.points.frustumCulled = false;
    this.points.visible = false;
    this.group.add(this.points);
  }

  /** Shows the body at a frame, and nothing where it is not known. */
  show(frame) {
    if (!this.motion) return;
    this.group.visible = poseMesh(this.motion, frame, this.centre, this.vertices.array);
    this.vertices.needsUpdate = true;
    if (!this.group.visible || !this.points || !this.points.visible) return;
    poseGaussians(this.motion, this.vertices.array, this.middles.array);
    this.middles.needsUpdate = true;
  }

  colour(theme) { if (this.motion) this.material.color.set(theme.people[0]); }
}
