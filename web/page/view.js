// The path in 3D, drawn by three.js from the steps that were made.
//
// Owned by main.js. Coordinates are work coordinates in mm, Z up. Draws only when something has changed. In a browser
// without WebGL a sentence takes its place, and the rest of the page works.

import * as THREE from 'three';
import { OrbitControls } from './vendor/OrbitControls.js';
import { LineSegments2 } from './vendor/lines/LineSegments2.js';
import { LineSegmentsGeometry } from './vendor/lines/LineSegmentsGeometry.js';
import { LineMaterial } from './vendor/lines/LineMaterial.js';
import { byId } from './dom.js';
import { colour } from './theme.js';

/// Colours from slow to fast. The legend in style.css repeats them.
const RAMP = ['#3d58b0', '#1a9aa6', '#4caf62', '#e0a020', '#dd5b2b'].map((hex) => new THREE.Color(hex));
/// With more segments than this the path is drawn as thin lines.
const WIDE = 120_000;
/// Most vertices of the trail of the connected machine.
const TRAIL = 20_000;

/// Writes the colour of a share of the highest speed to three numbers of an array.
function paint(colours, at, part) {
  const place = Math.min(Math.max(part, 0), 1) * (RAMP.length - 1);
  const low = Math.min(Math.floor(place), RAMP.length - 2);
  const [a, b, f] = [RAMP[low], RAMP[low + 1], place - low];
  colours[at] = a.r + (b.r - a.r) * f;
  colours[at + 1] = a.g + (b.g - a.g) * f;
  colours[at + 2] = a.b + (b.b - a.b) * f;
}

export class View {
  #scene = new THREE.Scene();
  #camera = new THREE.PerspectiveCamera(35, 1, 0.1, 20_000);
  #fixed = new THREE.Group();
  #tool = new THREE.Group();
  #path;
  #rest;
  #samples;
  #trail;
  #trailCount = 0;
  #box = { lower: [0, 0, 0], upper: [100, 100, 30] };
  #systems = [];
  #shown = new THREE.Box3(new THREE.Vector3(0, 0, -10), new THREE.Vector3(100, 100, 10));
  #asked = false;

  constructor(canvas) {
    this.canvas = canvas;
    this.#camera.up.set(0, 0, 1);
    try {
      this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true, alpha: true, preserveDrawingBuffer: true });
    } catch {
      byId('empty').textContent = 'This browser shows no 3D here; all else works.';
      return;
    }
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.controls = new OrbitControls(this.#camera, canvas);
    this.controls.addEventListener('change', () => this.draw());
    this.controls.listenToKeyEvents(canvas);
    this.#scene.add(this.#fixed, this.#tool);
    this.#makeTool();
    this.#makeTrail();
    new ResizeObserver(() => this.#resize()).observe(canvas.parentElement);
    document.addEventListener('theme', () => this.#makeFixed());
    this.#makeFixed();
    this.look('iso');
  }

  #resize() {
    const { clientWidth: width, clientHeight: height } = this.canvas.parentElement;
    if (width === 0 || height === 0) return;
    this.renderer.setSize(width, height, false);
    this.#camera.aspect = width / height;
    this.#camera.updateProjectionMatrix();
    for (const line of [this.#path, this.#rest]) line?.material.resolution?.set(width, height);
    this.draw();
  }

  draw() {
    if (!this.renderer || this.#asked) return;
    this.#asked = true;
    requestAnimationFrame(() => {
      this.#asked = false;
      this.renderer.render(this.#scene, this.#camera);
    });
  }

  /// Shows the ends of the machine's travel, in work coordinates, and the zeros of other coordinate systems: `{ name,
  /// place }` each.
  limits(lower, upper, systems = []) {
    this.#box = { lower, upper };
    this.#systems = systems;
    if (this.renderer) this.#makeFixed();
  }

  #makeFixed() {
    for (const old of [...this.#fixed.children]) {
      this.#fixed.remove(old);
      old.geometry?.dispose();
      old.material?.dispose();
    }
    const [lower, upper] = [new THREE.Vector3(...this.#box.lower), new THREE.Vector3(...this.#box.upper)];
    const size = upper.clone().sub(lower);
    const middle = lower.clone().add(upper).multiplyScalar(0.5);
    const edges = new THREE.EdgesGeometry(new THREE.BoxGeometry(Math.max(size.x, 0.01), Math.max(size.y, 0.01), Math.max(size.z, 0.01)));
    const box = new THREE.LineSegments(edges, new THREE.LineBasicMaterial({ color: colour('quiet'), transparent: true, opacity: 0.45 }));
    box.position.copy(middle);
    this.#fixed.add(box, this.#grid(lower, upper), ...this.#zero(size), ...this.#systems.flatMap((system) => this.#offset(system, size)));
    this.draw();
  }

  /// Draws a grid in the plane of the work zero, of 10 mm, or of 50 or 100 mm on larger machines.
  #grid(lower, upper) {
    const span = Math.max(upper.x - lower.x, upper.y - lower.y);
    const step = [10, 50, 100, 500].find((step) => span / step <= 40) ?? 1_000;
    const points = [];
    for (let x = Math.ceil(lower.x / step) * step; x <= upper.x; x += step) points.push(x, lower.y, 0, x, upper.y, 0);
    for (let y = Math.ceil(lower.y / step) * step; y <= upper.y; y += step) points.push(lower.x, y, 0, upper.x, y, 0);
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute('position', new THREE.Float32BufferAttribute(points, 3));
    return new THREE.LineSegments(geometry, new THREE.LineBasicMaterial({ color: colour('line') }));
  }

  /// Draws the axes at the work zero.
  #zero(size) {
    const shown = this.#shown.getSize(new THREE.Vector3()).length();
    const length = Math.min(Math.max(size.x, size.y) / 8, Math.max(shown / 5, 4), 60);
    const arrow = (x, y, z, tint) =>
      new THREE.ArrowHelper(new THREE.Vector3(x, y, z), new THREE.Vector3(), length, tint, length / 5, length / 9);
    return [arrow(1, 0, 0, 0xc8453b), arrow(0, 1, 0, 0x3d9a50), arrow(0, 0, 1, 0x3f6fd0)];
  }

  /// Draws a cross and a name at the zero of another coordinate system.
  #offset({ name, place: [x, y, z] }, size) {
    const arm = Math.max(size.x, size.y) / 40;
    const points = [x - arm, y, z, x + arm, y, z, x, y - arm, z, x, y + arm, z, x, y, z - arm, x, y, z + arm];
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute('position', new THREE.Float32BufferAttribute(points, 3));
    const cross = new THREE.LineSegments(geometry, new THREE.LineBasicMaterial({ color: colour('quiet') }));
    const canvas = new OffscreenCanvas(128, 48);
    const context = canvas.getContext('2d');
    context.font = '600 30px system-ui, sans-serif';
    context.fillStyle = colour('quiet');
    context.fillText(name, 4, 34);
    const label = new THREE.Sprite(new THREE.SpriteMaterial({ map: new THREE.CanvasTexture(canvas), depthTest: false }));
    label.scale.set(arm * 4, arm * 1.5, 1);
    label.position.set(x + arm * 2.2, y, z + arm);
    return [cross, label];
  }

  #makeTool() {
    const material = new THREE.MeshBasicMaterial({ color: 0x7d8a90, transparent: true, opacity: 0.75 });
    const tip = new THREE.Mesh(new THREE.ConeGeometry(0.22, 0.7, 24), material);
    tip.rotation.x = -Math.PI / 2;
    tip.position.z = 0.35;
    const shank = new THREE.Mesh(new THREE.CylinderGeometry(0.22, 0.22, 1.3, 24), material);
    shank.rotation.x = Math.PI / 2;
    shank.position.z = 1.35;
    this.#tool.add(tip, shank);
    this.#tool.visible = false;
  }

  #makeTrail() {
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute('position', new THREE.BufferAttribute(new Float32Array(3 * TRAIL), 3));
    geometry.setDrawRange(0, 0);
    this.#trail = new THREE.Line(geometry, new THREE.LineBasicMaterial({ color: 0x0e9a9a }));
    this.#trail.frustumCulled = false;
    this.#scene.add(this.#trail);
  }

  /// Shows a path: vertices, the sample of each, and the velocity of each sample, up to `fastest`.
  show(path, velocity, fastest) {
    if (!this.renderer) return;
    this.#forget();
    this.clearTrail();
    this.#samples = path.samples;
    const count = Math.max(path.samples.length - 1, 0);
    const positions = new Float32Array(6 * count);
    const colours = new Float32Array(6 * count);
    for (let i = 0; i < count; i++) {
      positions.set(path.vertices.subarray(3 * i, 3 * i + 6), 6 * i);
      paint(colours, 6 * i, velocity[path.samples[i]] / fastest);
      paint(colours, 6 * i + 3, velocity[path.samples[i + 1]] / fastest);
    }
    [this.#path, this.#rest] = count <= WIDE ? this.#wide(positions, colours) : this.#thin(positions, colours);
    this.#scene.add(this.#rest, this.#path);
    this.#shown = new THREE.Box3().setFromArray(path.vertices.length ? path.vertices : [0, 0, 0, 1, 1, 1]);
    const span = this.#shown.getSize(new THREE.Vector3());
    this.#tool.scale.setScalar(Math.max(span.length() / 22, 1.2));
    this.#tool.visible = true;
    this.#makeFixed();
    this.#resize();
    this.look('iso');
  }

  #wide(positions, colours) {
    const line = (options) => {
      const geometry = new LineSegmentsGeometry().setPositions(positions).setColors(colours);
      return new LineSegments2(geometry, new LineMaterial({ vertexColors: true, ...options }));
    };
    return [line({ linewidth: 2.2 }), line({ linewidth: 1.2, transparent: true, opacity: 0.22, depthWrite: false })];
  }

  #thin(positions, colours) {
    const geometry = () => {
      const geometry = new THREE.BufferGeometry();
      geometry.setAttribute('position', new THREE.BufferAttribute(positions, 3));
      geometry.setAttribute('color', new THREE.BufferAttribute(colours, 3));
      return geometry;
    };
    const line = (options) => new THREE.LineSegments(geometry(), new THREE.LineBasicMaterial({ vertexColors: true, ...options }));
    return [line({}), line({ transparent: true, opacity: 0.15, depthWrite: false })];
  }

  #forget() {
    for (const line of [this.#path, this.#rest]) {
      if (!line) continue;
      this.#scene.remove(line);
      line.geometry.dispose();
      line.material.dispose();
    }
    this.#path = this.#rest = undefined;
  }

  /// Shows the tool at a place, and a share of the path as done.
  at(place, sample) {
    if (!this.renderer) return;
    this.#tool.position.set(...place);
    this.#tool.visible = true;
    if (this.#path && sample !== undefined) {
      const done = below(this.#samples, sample);
      const { geometry } = this.#path;
      if (geometry.isInstancedBufferGeometry) geometry.instanceCount = done;
      else geometry.setDrawRange(0, 2 * done);
    }
    this.draw();
  }

  /// Extends the trail of the connected machine: three numbers for each place.
  follow(places) {
    if (!this.renderer || places.length === 0) return;
    const attribute = this.#trail.geometry.getAttribute('position');
    const count = places.length / 3;
    if (this.#trailCount + count > TRAIL) {
      // Drops the older half.
      attribute.array.copyWithin(0, 3 * (TRAIL / 2), 3 * this.#trailCount);
      this.#trailCount = Math.max(this.#trailCount - TRAIL / 2, 0);
    }
    attribute.array.set(places.slice(-3 * (TRAIL / 2)), 3 * this.#trailCount);
    this.#trailCount += Math.min(count, TRAIL / 2);
    attribute.needsUpdate = true;
    this.#trail.geometry.setDrawRange(0, this.#trailCount);
    this.at(places.slice(-3));
  }

  clearTrail() {
    this.#trailCount = 0;
    this.#trail?.geometry.setDrawRange(0, 0);
    this.draw();
  }

  /// Selects whether a whole job is shown, or the connected machine.
  showJob(on) {
    for (const line of [this.#path, this.#rest]) if (line) line.visible = on;
    if (this.#trail) this.#trail.visible = !on;
    this.draw();
  }

  /// Looks at the whole path from one side.
  look(from) {
    if (!this.renderer) return;
    const directions = { iso: [-0.55, -1, 0.75], top: [0, -0.0001, 1], front: [0, -1, 0.0001], side: [1, 0, 0.0001] };
    const middle = this.#shown.getCenter(new THREE.Vector3());
    const radius = Math.max(this.#shown.getSize(new THREE.Vector3()).length() / 2, 2);
    const half = Math.min(1, this.#camera.aspect) * Math.tan((this.#camera.fov * Math.PI) / 360);
    const direction = new THREE.Vector3(...directions[from]).normalize();
    this.controls.target.copy(middle);
    this.#camera.position.copy(middle).addScaledVector(direction, (radius / half) * 1.08);
    this.#camera.near = radius / 100;
    this.#camera.far = radius * 200;
    this.#camera.updateProjectionMatrix();
    this.controls.update();
    this.draw();
  }
}

/// Returns the number of segments that end at or before a sample.
function below(samples, sample) {
  let [low, high] = [0, samples.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (samples[middle] <= sample) low = middle + 1;
    else high = middle;
  }
  return Math.max(low - 1, 0);
}
