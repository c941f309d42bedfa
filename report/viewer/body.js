// The fitted body of one time step in its colours or see-through, and its Gaussians as points.
import { BufferAttribute, BufferGeometry, DoubleSide, Group, LinearFilter, Mesh, MeshBasicMaterial, MeshPhongMaterial, Points, PointsMaterial, Texture, VertexColors } from 'three/build/three.module.js';
import { poseBody, poseGaussians, posePlayer, readBody, readPlayer, readTexture } from './motion.js';

const LEAST_OPACITY = 90;  // of 255: fainter Gaussians are no points

export class BodyView {
  /** `redraw` is called when the image of its colours is there. */
  constructor(root, bounds, redraw) {
    this.group = new Group();
    this.centre = bounds.centre;
    this.shown = this.coloured = true;
    const own = root.querySelector('[data-body]'), colours = root.querySelector('[data-texture]'), player = document.querySelector('.player[data-file]');
    this.body = own ? readBody(own.getAttribute('data-body')) : null;
    this.player = player ? readPlayer(player.dataset.file.slice(player.dataset.file.indexOf(',') + 1)) : null;
    const posed = this.body || this.player;
    if (!posed) return;
    const shape = new BufferGeometry();
    this.vertices = new BufferAttribute(new Float32Array(3 * posed.vertices), 3);
    shape.setAttribute('position', this.vertices);
    shape.setIndex(new BufferAttribute(posed.corner, 1));
    this.material = new MeshPhongMaterial({ flatShading: true, side: DoubleSide, shininess: 0, transparent: true, opacity: 0.55, polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1 });
    this.mesh = new Mesh(shape, this.material);
    this.mesh.frustumCulled = false;
    this.group.add(this.mesh);
    if (this.body && colours) this.addSkin(readTexture(colours.getAttribute('data-texture')), redraw);
    const fits = this.player && this.player.vertices === posed.vertices && this.player.faces === posed.faces;
    if (fits && this.player.gaussians > 0) this.addPoints();
  }

  /** The same surface with an image on it, cut where the image has seams. */
  addSkin(colours, redraw) {
    if (colours.vertex.some((vertex) => vertex >= this.body.vertices)) return;  // of another body
    const shape = new BufferGeometry(), image = new Image(), map = new Texture(image);
    this.corners = colours.vertex;
    this.places = new BufferAttribute(new Float32Array(3 * this.corners.length), 3);
    shape.setAttribute('position', this.places);
    shape.setAttribute('uv', new BufferAttribute(colours.uv, 2));
    shape.setIndex(new BufferAttribute(colours.corner, 1));
    map.flipY = false;
    map.generateMipmaps = false;
    map.minFilter = LinearFilter;
    image.onload = () => {
      map.needsUpdate = true;
      this.skin = new Mesh(shape, new MeshBasicMaterial({ map, side: DoubleSide }));
      this.skin.frustumCulled = false;
      this.group.add(this.skin);
      redraw();
    };
    image.src = colours.address;
  }

  addPoints() {
    const { gaussians, looks } = this.player, colours = new Float32Array(3 * gaussians);
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
    if (!this.mesh) return;
    const at = this.vertices.array, dots = Boolean(this.points && this.points.visible), inColours = Boolean(this.skin) && this.coloured && !dots;
    this.group.visible = this.body ? poseBody(this.body, frame, this.centre, at) : posePlayer(this.player, frame, this.centre, at);
    this.mesh.visible = this.shown && !inColours;
    this.vertices.needsUpdate = true;
    if (this.skin) this.skin.visible = this.shown && inColours;
    if (this.group.visible && inColours) this.showSkin(at);
    if (!this.group.visible || !dots) return;
    poseGaussians(this.player, at, this.middles.array);
    this.middles.needsUpdate = true;
  }

  showSkin(at) {
    const to = this.places.array;
    this.corners.forEach((vertex, i) => { for (let k = 0; k < 3; ++k) to[3 * i + k] = at[3 * vertex + k]; });
    this.places.needsUpdate = true;
  }

  colour(theme) { if (this.mesh) this.material.color.set(theme.people[0]); }
}
