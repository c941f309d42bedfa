// The view, its controls and its state in the address.
import { AmbientLight, Color, DirectionalLight, PerspectiveCamera, Scene, Vector3, WebGLRenderer } from 'three/build/three.module.js';
import { OrbitControls } from 'three/examples/jsm/controls/OrbitControls.js';
import { BodyView } from './body.js';
import { People } from './data.js';
import { element } from './element.js';
import { cameraPanel, jointPanel } from './panel.js';
import { PeopleView } from './people.js';
import { Rig, boundsOf, upOf } from './rig.js';
import { Strip } from './strip.js';
import { readTheme } from './theme.js';
import { readState, writeState } from './address.js';

const NEAR_PX = 18, VIEW_DEG = 40;

export class Studio {
  constructor(root, canvas, context) {
    this.root = root;
    this.scene = JSON.parse(root.getAttribute('data-scene'));
    this.people = new People(this.scene, root.querySelectorAll('[data-chunk]'));
    this.bounds = boundsOf(this.scene, this.people);
    this.step = 0;
    this.camera = -1;    // chosen
    this.joint = null;   // chosen
    this.speed = 1;
    this.makeView(canvas, context);
    this.makePage(canvas);
    this.addImages();
    this.theme();
    matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => this.theme());
    addEventListener('hashchange', () => this.readAddress());
    root.addEventListener('paint', () => this.paint());
    new ResizeObserver(() => this.resize()).observe(this.stage);
    this.resize();
    this.home();
    this.readAddress();
    this.update();
    root.dataset.state = 'ready';
  }

  makeView(canvas, context) {
    this.renderer = new WebGLRenderer({ canvas, context, antialias: true, alpha: false });
    this.renderer.setPixelRatio(Math.min(2, devicePixelRatio || 1));
    this.world = new Scene();
    this.view = new PerspectiveCamera(VIEW_DEG, 1, 0.002 * this.bounds.radius, 60 * this.bounds.radius);
    this.view.up.copy(upOf(this.scene));
    this.rig = new Rig(this.scene, this.bounds);
    this.bodies = new PeopleView(this.people, this.bounds);
    this.body = new BodyView(this.root, this.bounds, () => this.showColours());
    const light = new DirectionalLight(0xffffff, 0.6);
    light.position.copy(upOf(this.scene)).add(new Vector3(0.3, 0.2, 0.1));
    this.world.add(this.rig.group, this.bodies.group, this.body.group, light, new AmbientLight(0xffffff, 0.62));
    this.turn = new OrbitControls(this.view, canvas);
    this.turn.enableKeys = false;
    this.turn.enableZoom = false;  // until it is clicked: the wheel scrolls the page
    this.turn.addEventListener('change', () => this.draw());
    this.turn.addEventListener('start', () => { this.turned = true; });
    this.turn.addEventListener('end', () => this.keepAddress());
  }

  makePage(canvas) {
    const { people, scene } = this, moves = people.frames.length > 1;
    canvas.tabIndex = 0;
    canvas.setAttribute('role', 'application');
    canvas.setAttribute('aria-label', 'The studio in 3D: ' + scene.cameras.length + ' cameras, ' + people.ids.length + ' people, ' + people.frames.length + ' time steps');
    canvas.addEventListener('focus', () => { this.turn.enableZoom = true; });
    canvas.addEventListener('blur', () => { this.turn.enableZoom = false; });
    canvas.addEventListener('pointerdown', (event) => { this.down = [event.clientX, event.clientY]; canvas.focus({ preventScroll: true }); });
    canvas.addEventListener('pointerup', (event) => this.pick(event));
    this.canvas = canvas;
    this.labels = scene.cameras.map((camera) => element('span', { 'aria-hidden': 'true' }, camera.name));
    this.panel = element('aside', { 'aria-live': 'polite', hidden: '' });
    this.stage = element('div', { class: 'stage' }, canvas, element('div', { class: 'names' }, ...this.labels), this.panel);
    this.play = element('button', { type: 'button', onclick: () => this.toggle() }, 'Play');
    this.slider = element('input', { type: 'range', min: '0', max: String(Math.max(0, people.frames.length - 1)), value: '0', 'aria-label': 'time step', oninput: () => { this.pause(); this.go(Number(this.slider.value)); } });
    this.told = element('output');
    const speed = element('select', { 'aria-label': 'speed', onchange: () => { this.speed = Number(speed.value); } }, ...[0.1, 0.25, 0.5, 1, 2, 5, 20].map((v) => element('option', v === 1 ? { value: v, selected: '' } : { value: v }, v + '\u00d7')));
    const bar = element('div', { class: 'bar' }, this.play, this.slider, this.told, speed);
    bar.hidden = !moves;
    this.measured = people.spans.some((span) => span[2] !== null);
    this.strip = moves && people.spans.length > 1 && (this.measured || people.spans.some((span) => span[3] > 0)) ? new Strip(people, scene.held_out || [], (step) => { this.pause(); this.go(step); }) : null;
    this.root.replaceChildren(this.stage, bar, this.makeSwitches(), ...(this.strip ? [this.strip.root] : []), element('details', {}, element('summary', {}, 'Mouse and keys'), element('p', {}, this.help())));
    this.root.addEventListener('keydown', (event) => this.key(event));
  }

  makeSwitches() {
    const { people, scene } = this;
    const flip = (text, on, change) => {
      const box = element('input', { type: 'checkbox', onchange: () => { change(box.checked); this.update(); } });
      box.checked = on;
      return element('label', {}, box, ' ' + text);
    };
    this.chooser = element('select', { 'aria-label': 'camera', onchange: () => this.chooseCamera(Number(this.chooser.value)) }, element('option', { value: '-1' }, 'no camera'), ...scene.cameras.map((camera, i) => element('option', { value: i }, camera.name)));
    this.imagesSwitch = flip('images', true, (on) => { this.rig.images.visible = on; });
    const scaleText = element('span'), scale = element('input', { type: 'range', min: '0', max: '6', step: '1', value: '0', 'aria-label': 'size of the ellipsoids', oninput: () => tell() });
    const tell = () => {
      this.bodies.scale = [1, 2, 5, 10, 20, 50, 100][Number(scale.value)];
      scaleText.textContent = this.bodies.scale === 1 ? 'true size' : 'drawn ' + this.bodies.scale + '\u00d7 too large';
      this.update();
    };
    scaleText.textContent = 'true size';
    const parts = [this.chooser, element('button', { type: 'button', onclick: () => { this.home(); this.keepAddress(); } }, 'Whole rig'), this.imagesSwitch, flip('floor', true, (on) => { this.rig.floor.visible = on; })];
    if ((scene.boards || []).length > 0) parts.push(flip('boards', this.rig.boards.visible, (on) => { this.rig.boards.visible = on; }));
    this.jointsSwitch = flip('joints', true, (on) => { this.bodies.joints = on; });
    if (people.frames.length > 0) parts.push(this.jointsSwitch);
    if (this.measured) parts.push(flip('ellipsoids of 2\u03c3', true, (on) => { this.bodies.ellipsoids = on; }), element('label', {}, scale, ' ', scaleText));
    if (this.body.mesh) parts.push(flip('fitted body', true, (on) => { this.body.shown = on; }));
    this.coloursSwitch = flip('its colours', true, (on) => { this.body.coloured = on; });
    this.coloursSwitch.hidden = !this.body.skin;
    parts.push(this.coloursSwitch);
    if (this.body.points) parts.push(flip('Gaussians', false, (on) => { this.body.points.visible = on; }));
    return element('div', { class: 'bar' }, ...parts);
  }

  /** The body's colours have come; the joints of the only person would poke out of them. */
  showColours() {
    this.coloursSwitch.hidden = false;
    if (this.people.ids.length === 1 && !this.joint) this.bodies.joints = this.jointsSwitch.firstChild.checked = false;
    this.update();
  }

  help() {
    const cell = this.rig.cell, unit = cell >= 1 ? cell + '\u2009m' : Number((1000 * cell).toPrecision(1)) + '\u2009mm';
    const time = this.people.frames.length > 1 ? 'space plays, \u2190 \u2192 go a time step (with Shift ten), \u2191 \u2193 choose a joint, ' : '';
    return 'A cell of the floor is ' + unit + '. Drag turns, wheel or two fingers come closer; a click on a camera or a joint tells about it. Keys: ' + time + '[ ] choose a camera, Home shows the whole rig, Esc chooses nothing.';
  }

  /** Images of the cameras are those that the page shows elsewhere: people if there are any, who come after the boards. */
  addImages() {
    this.images = {};
    const places = Array.from(document.querySelectorAll('[data-camera][data-box]'));
    for (const place of this.people.frames.length > 0 ? places.reverse() : places) {
      const name = place.getAttribute('data-camera'), index = this.scene.cameras.findIndex((camera) => camera.name === name), box = place.getAttribute('data-box').split(' ').map(Number);
      const shown = place.querySelector('image'), href = shown && shown.getAttribute('href');
      if (index < 0 || this.images[index] || !href || !href.startsWith('data:image/') || !box.every(Number.isFinite)) continue;
      this.images[index] = href;
      const image = new Image();
      image.onload = () => { this.rig.addImage(index, image, box); this.draw(); };
      image.src = href;
    }
    this.imagesSwitch.hidden = Object.keys(this.images).length === 0;
  }

  theme() {
    this.colours = readTheme(this.root);
    this.renderer.setClearColor(new Color(this.colours.ground));
    this.bodies.colour(this.colours);
    this.body.colour(this.colours);
    if (this.strip) this.strip.colour(this.colours);
    this.update();
  }

  resize() {
    const width = Math.max(1, this.stage.clientWidth), height = Math.max(1, this.stage.clientHeight);
    this.renderer.setSize(width, height, false);
    this.view.aspect = width / height;
    this.view.updateProjectionMatrix();
    if (!this.turned) this.home();
    this.draw();
  }

  /** Until somebody turns the view it holds the whole rig, however large it is. */
  home() {
    this.turned = false;
    const up = upOf(this.scene), side = new Vector3(up.y, up.z, up.x), across = new Vector3().crossVectors(up, side);
    const direction = side.multiplyScalar(0.75).addScaledVector(across, -0.55).addScaledVector(up, 0.5).normalize();
    const right = new Vector3().crossVectors(up, direction).normalize(), above = new Vector3().crossVectors(direction, right);
    const points = this.scene.cameras.map((camera) => this.rig.at(camera)).concat(this.rig.middles, (this.bodies.shown || []).map((shown) => shown.at));
    const tangent = 0.86 * Math.tan(VIEW_DEG * Math.PI / 360), aspect = this.view.aspect || 1;
    let distance = 0.5 * this.bounds.radius;
    for (const p of points) distance = Math.max(distance, p.dot(direction) + Math.max(Math.abs(p.dot(right)) / aspect, Math.abs(p.dot(above))) / tangent);
    this.look(direction.multiplyScalar(distance), new Vector3());
  }

  look(from, at) {
    this.view.fov = VIEW_DEG;
    this.view.updateProjectionMatrix();
    this.view.position.copy(from);
    this.turn.target.copy(at);
    this.turn.update();
    this.draw();
  }

  lookThrough(index) {
    this.turned = true;
    const camera = this.scene.cameras[index], at = this.rig.at(camera), ahead = new Vector3(...camera.axes.slice(6)), far = Math.max(at.dot(ahead) * -1, this.rig.depth);
    this.look(at.clone().addScaledVector(ahead, -0.02 * this.rig.depth), at.clone().addScaledVector(ahead, far));
    this.view.fov = Math.min(100, 2.2 * Math.atan(camera.half[1]) * 180 / Math.PI);
    this.view.updateProjectionMatrix();
    this.draw();
    this.keepAddress();
  }

  go(step) {
    const count = this.people.frames.length;
    if (count === 0) return;
    this.step = Math.max(0, Math.min(count - 1, step));
    this.update();
    if (!this.playing) this.keepAddress();
  }

  toggle() { if (this.playing) this.pause(); else this.start(); }

  start() {
    if (this.people.frames.length < 2) return;
    if (this.step >= this.people.frames.length - 1) this.step = 0;
    this.playing = true;
    this.play.textContent = 'Pause';
    let last = performance.now(), exact = this.step;
    const next = (now) => {
      if (!this.playing) return;
      if (Math.floor(exact) !== this.step) exact = this.step;
      exact += (now - last) / 1000 * this.speed * this.people.rate;
      last = now;
      if (exact >= this.people.frames.length) exact = 0;
      if (Math.floor(exact) !== this.step) this.go(Math.floor(exact));
      requestAnimationFrame(next);
    };
    requestAnimationFrame(next);
  }

  pause() {
    if (!this.playing) return;
    this.playing = false;
    this.play.textContent = 'Play';
    this.keepAddress();
  }

  chooseCamera(index) { this.camera = index; this.joint = null; this.update(); this.keepAddress(); }
  chooseJoint(joint) { this.joint = joint; this.camera = -1; this.update(); this.keepAddress(); }

  pick(event) {
    const [x, y] = this.down || [NaN, NaN];
    this.down = null;
    if (!(Math.hypot(event.clientX - x, event.clientY - y) < 5)) return;
    const bounds = this.canvas.getBoundingClientRect();
    let best = null, least = event.pointerType === 'touch' ? 1.6 * NEAR_PX : NEAR_PX;
    const offer = (at, found) => {
      const p = at.clone().project(this.view), distance = Math.hypot((p.x + 1) / 2 * bounds.width - (event.clientX - bounds.left), (1 - p.y) / 2 * bounds.height - (event.clientY - bounds.top));
      if (p.z > -1 && p.z < 1 && distance < least) { best = found; least = distance; }
    };
    this.scene.cameras.forEach((camera, i) => { offer(this.rig.at(camera), i); offer(this.rig.middles[i], i); });
    for (const shown of this.bodies.shown || []) offer(shown.at, shown);
    if (best !== null && typeof best === 'object') this.chooseJoint({ person: best.person, joint: best.joint });
    else this.chooseCamera(best === null ? -1 : best);
  }

  key(event) {
    const tag = event.target.tagName;
    if (event.ctrlKey || event.metaKey || event.altKey || (tag === 'SELECT' && event.key !== 'Escape') || (tag === 'INPUT' && event.key.startsWith('Arrow'))) return;
    const by = event.shiftKey ? 10 : 1, cameras = this.scene.cameras.length, joints = this.people.joints.length * this.people.ids.length;
    const nextJoint = (d) => {
      const now = this.joint ? this.joint.person * this.people.joints.length + this.joint.joint : d > 0 ? -1 : 0, next = (now + d + joints) % joints;
      this.chooseJoint({ person: Math.floor(next / this.people.joints.length), joint: next % this.people.joints.length });
    };
    const actions = {
      ' ': () => this.toggle(), ArrowLeft: () => { this.pause(); this.go(this.step - by); }, ArrowRight: () => { this.pause(); this.go(this.step + by); },
      ArrowUp: () => joints > 0 && nextJoint(-1), ArrowDown: () => joints > 0 && nextJoint(1),
      '[': () => cameras > 0 && this.chooseCamera((Math.max(this.camera, 0) - 1 + cameras) % cameras), ']': () => cameras > 0 && this.chooseCamera((this.camera + 1) % cameras),
      Home: () => { this.home(); this.keepAddress(); }, Escape: () => this.chooseCamera(-1),
    };
    if (!actions[event.key] || (event.key === ' ' && (tag === 'BUTTON' || tag === 'INPUT' || tag === 'SUMMARY'))) return;
    actions[event.key]();
    event.preventDefault();
  }

  readAddress() {
    const state = readState(location.hash);
    if (!state) return;
    this.pause();
    const index = this.scene.cameras.findIndex((camera) => camera.name === state.camera), [person, ...joint] = (state.joint || '').split('.');
    const known = { person: this.people.ids.indexOf(Number(person)), joint: this.people.joints.indexOf(joint.join('.')) };
    if (this.strip) this.strip.order(state.show);
    this.camera = index;
    this.joint = known.person >= 0 && known.joint >= 0 ? known : null;
    if (state.frame !== null && this.people.frames.length > 0) this.step = this.people.stepOf(state.frame);
    const local = (v) => new Vector3(...v.map((x, i) => x - this.bounds.centre[i]));
    if (state.eye && state.look) this.turned = true;
    if (state.eye && state.look) this.look(local(state.eye), local(state.look));
    this.update();
    this.root.scrollIntoView({ block: 'nearest' });
  }

  keepAddress() {
    if (this.root.dataset.state !== 'ready') return;
    const camera = this.scene.cameras[this.camera], world = (v) => v.toArray().map((x, i) => x + this.bounds.centre[i]);
    writeState({
      frame: this.people.frames.length > 0 ? this.people.frames[this.step] : null, show: this.strip && this.strip.how !== 'all' ? this.strip.how : null, camera: camera ? camera.name : null,
      joint: this.joint ? this.people.ids[this.joint.person] + '.' + this.people.joints[this.joint.joint] : null,
      eye: world(this.view.position), look: world(this.turn.target),
    });
  }

  update() {
    if (!this.colours) return;
    const { people } = this;
    this.rig.colour(this.colours, this.camera);
    if (people.frames.length > 0) {
      this.bodies.show(this.step, this.joint);
      this.body.show(people.frames[this.step]);
      this.slider.value = String(this.step);
      this.told.textContent = 'frame ' + people.frames[this.step];
      if (this.strip) this.strip.show(this.step);
    }
    this.chooser.value = String(this.camera);
    const camera = this.scene.cameras[this.camera];
    this.panel.hidden = !camera && !this.joint;
    if (camera) this.panel.replaceChildren(...cameraPanel(camera, this.images[this.camera], () => this.lookThrough(this.camera)));
    else if (this.joint) this.panel.replaceChildren(...jointPanel(people, this.step, this.joint, this.scene.round));
    this.draw();
  }

  draw() {
    if (this.asked) return;
    this.asked = true;
    requestAnimationFrame(() => { this.asked = false; this.paint(); });
  }

  /** At once; the event `paint` asks for it, for tests and for images of the page. */
  paint() {
    this.renderer.render(this.world, this.view);
    this.placeNames();
    this.root.dataset.draws = Number(this.root.dataset.draws || 0) + 1;
  }

  /** Only where they moved: the page is drawn anew below each of them. */
  placeNames() {
    const width = this.stage.clientWidth, height = this.stage.clientHeight, placed = [width, height, this.view.aspect, this.camera, ...this.view.matrixWorld.elements, this.view.fov].join();
    if (placed === this.placed) return;
    this.placed = placed;
    this.scene.cameras.forEach((camera, i) => {
      const p = this.rig.at(camera).project(this.view), label = this.labels[i];
      label.hidden = !(p.z > -1 && p.z < 1 && Math.abs(p.x) < 1 && Math.abs(p.y) < 1);
      label.className = i === this.camera ? 'chosen' : '';
      label.style.transform = 'translate(' + Math.round((p.x + 1) / 2 * width) + 'px,' + Math.round((1 - p.y) / 2 * height) + 'px)';
    });
  }
}
