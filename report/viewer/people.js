// People of one time step: joints, bones, ellipsoids of their covariance, the track of a chosen joint.
import { BufferAttribute, BufferGeometry, Color, CylinderBufferGeometry, Group, InstancedMesh, Line, LineBasicMaterial, Matrix4, Mesh, MeshBasicMaterial, MeshLambertMaterial, Quaternion, SphereBufferGeometry, Vector3 } from 'three/build/three.module.js';
import { factorOf } from './data.js';

const TRACK = 60;  // time steps before and after
const NOTHING = new Matrix4().makeScale(0, 0, 0);
const Y = new Vector3(0, 1, 0);

function instances(geometry, material, count) {
  const mesh = new InstancedMesh(geometry, material, Math.max(1, count));
  mesh.frustumCulled = false;
  for (let i = 0; i < Math.max(1, count); ++i) mesh.setMatrixAt(i, NOTHING);
  return mesh;
}

export class PeopleView {
  constructor(people, bounds) {
    this.people = people;
    this.centre = bounds.centre;
    this.group = new Group();
    this.scale = 1;
    this.ellipsoids = this.joints = true;
    this.radius = this.boneRadius(bounds.radius);
    const dot = new SphereBufferGeometry(1, 8, 6), bone = new CylinderBufferGeometry(1, 1, 1, 6, 1, true), ball = new SphereBufferGeometry(1, 12, 8);
    this.each = people.ids.map(() => {
      const solid = new MeshLambertMaterial(), clear = new MeshLambertMaterial({ transparent: true, opacity: 0.32, depthWrite: false });
      const parts = { solid, clear, dots: instances(dot, solid, people.joints.length), bones: instances(bone, solid, people.bones.length), balls: instances(ball, clear, people.joints.length) };
      this.group.add(parts.dots, parts.bones, parts.balls);
      return parts;
    });
    this.mark = new Mesh(dot, new MeshBasicMaterial());
    this.mark.visible = false;
    this.track = new Line(new BufferGeometry(), new LineBasicMaterial());
    this.track.frustumCulled = false;
    this.trackAt = new Float32Array(3 * (2 * TRACK + 1));
    this.track.geometry.setAttribute('position', new BufferAttribute(this.trackAt, 3));
    this.group.add(this.mark, this.track);
  }

  /** From the bones' usual length. */
  boneRadius(extent) {
    const lengths = [], { people } = this;
    for (let step = 0; step < people.frames.length && step < 50 && lengths.length < 20; ++step) {
      for (let person = 0; person < people.ids.length; ++person) {
        for (const [a, b] of people.bones) {
          const from = people.joint(step, person, a), to = people.joint(step, person, b);
          if (from && to) lengths.push(Math.hypot(...[0, 1, 2].map((i) => from.at[i] - to.at[i])));
        }
      }
    }
    lengths.sort((a, b) => a - b);
    return lengths.length > 0 ? Math.max(0.08 * lengths[lengths.length >> 1], 1e-5 * extent) : 0.006 * extent;
  }

  place(joint) { return new Vector3(...[0, 1, 2].map((i) => joint.at[i] - this.centre[i])); }

  /** Shows a time step; `chosen`: {person, joint} or null. */
  show(step, chosen) {
    const { people } = this, matrix = new Matrix4();
    this.shown = [];  // for picking
    this.each.forEach((parts, person) => {
      const places = people.joints.map((name, j) => {
        const joint = people.joint(step, person, j);
        if (!joint) { parts.dots.setMatrixAt(j, NOTHING); parts.balls.setMatrixAt(j, NOTHING); return null; }
        const at = this.place(joint), r = 1.5 * this.radius;
        this.shown.push({ person, joint: j, at });
        parts.dots.setMatrixAt(j, matrix.makeScale(r, r, r).setPosition(at));
        parts.balls.setMatrixAt(j, this.ellipsoid(joint, at, matrix));
        return at;
      });
      people.bones.forEach(([a, b], i) => parts.bones.setMatrixAt(i, this.bone(places[a], places[b], matrix)));
      for (const mesh of [parts.dots, parts.bones, parts.balls]) mesh.instanceMatrix.needsUpdate = true;
      parts.dots.visible = parts.bones.visible = this.joints;
      parts.balls.visible = this.ellipsoids && this.joints;
    });
    this.showChosen(step, chosen);
  }

  ellipsoid(joint, at, matrix) {
    if (joint.sigma.some((s) => !(s >= 0))) return NOTHING;
    const k = 2 * this.scale, [a, b, c, d, e, f] = factorOf(joint.sigma, joint.correlation).map((v) => k * v);
    return matrix.set(a, 0, 0, at.x, b, c, 0, at.y, d, e, f, at.z, 0, 0, 0, 1);
  }

  bone(a, b, matrix) {
    if (!a || !b) return NOTHING;
    const along = b.clone().sub(a), length = along.length(), turn = new Quaternion().setFromUnitVectors(Y, along.divideScalar(length || 1));
    return matrix.compose(a.clone().add(b).multiplyScalar(0.5), turn, new Vector3(this.radius, length, this.radius));
  }

  showChosen(step, chosen) {
    const joint = chosen && this.people.joint(step, chosen.person, chosen.joint);
    this.mark.visible = Boolean(joint);
    if (joint) { this.mark.position.copy(this.place(joint)); this.mark.scale.setScalar(2.2 * this.radius); }
    let count = 0;
    for (let s = step - TRACK; chosen && s <= step + TRACK; ++s) {
      const other = s >= 0 && s < this.people.frames.length ? this.people.joint(s, chosen.person, chosen.joint) : null;
      if (other) for (let i = 0; i < 3; ++i) this.trackAt[3 * count + i] = other.at[i] - this.centre[i];
      if (other) ++count;
    }
    this.track.geometry.getAttribute('position').needsUpdate = true;
    this.track.geometry.setDrawRange(0, count);
    this.track.visible = count > 1;
  }

  colour(theme) {
    this.each.forEach((parts, i) => {
      const colour = new Color(theme.people[i % theme.people.length]);
      parts.solid.color.copy(colour);
      parts.clear.color.copy(colour);
    });
    this.mark.material.color.set(theme.chosen);
    this.track.material.color.set(theme.chosen);
  }
}
