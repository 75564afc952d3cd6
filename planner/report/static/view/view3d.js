// The cell in space: bodies carried by links, a path, poses, and a slider through time. Lengths in mm, z up.
import * as THREE from "./three/three.module.min.js";
import { Orbit } from "./orbit.js";
import { make } from "./make.js";

const ROLES = { calibrate: "#0072B2", repeat: "#009E73", validate: "#CC79A7", mount: "#E69F00" };
const MANY = 100; // poses: more of them hide the robot
const TANGLED = 30; // poses: the path through more of them hides it
const LINES = { "measuring path": "#3c3c3c", "path to the start": "#8c8c8c" };

// Orange, green and blue of Okabe and Ito, which the colour-blind tell apart; the letters say it too.
const AXES = [["x", "#D55E00", [1, 0, 0]], ["y", "#009E73", [0, 1, 0]], ["z", "#0072B2", [0, 0, 1]]];

function letterSprite(text, colour, height) {
  const canvas = document.createElement("canvas"), size = 64;
  canvas.width = canvas.height = size;
  const pen = canvas.getContext("2d");
  Object.assign(pen, { font: "bold 52px sans-serif", textAlign: "center", textBaseline: "middle", lineWidth: 8 });
  Object.assign(pen, { strokeStyle: "#ffffff", fillStyle: colour });
  pen.strokeText(text, size / 2, size / 2);
  pen.fillText(text, size / 2, size / 2);
  const map = new THREE.CanvasTexture(canvas);
  map.colorSpace = THREE.SRGBColorSpace;
  const sprite = new THREE.Sprite(new THREE.SpriteMaterial({ map }));
  sprite.scale.set(height, height, 1); // mm
  return sprite;
}

function unpack(text, Type) {
  const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  return new Type(bytes.buffer);
}

export class CellView {
  constructor(stage, view) {
    this.stage = stage;
    this.view = view;
    this.poses = unpack(view.poses, Float32Array);
    this.layers = new Map();
    this.carriers = Array.from({ length: view.carriers }, () => this.carrier());
    this.scene = new THREE.Scene();
    this.scene.add(...this.carriers);
    this.build();
    this.renderer = new THREE.WebGLRenderer({ antialias: true, alpha: true, preserveDrawingBuffer: true });
    this.renderer.setPixelRatio(Math.min(2, window.devicePixelRatio));
    this.camera = new THREE.PerspectiveCamera(38, 1, 10, 60000);
    this.camera.up.set(0, 0, 1);
    const low = new THREE.Vector3(...view.low_mm), high = new THREE.Vector3(...view.high_mm);
    this.orbit = new Orbit(stage, this.camera, low, high, () => this.draw());
    stage.replaceChildren(this.renderer.domElement);
    new ResizeObserver(() => this.resize()).observe(stage);
    this.show(0);
    this.resize();
  }

  carrier() {
    const group = new THREE.Group();
    group.matrixAutoUpdate = false;
    return group;
  }

  layer(name, colour, node) {
    if (!this.layers.has(name)) this.layers.set(name, { colour, nodes: [] });
    this.layers.get(name).nodes.push(node);
    return node;
  }

  build() {
    const sun = new THREE.DirectionalLight("#ffffff", 2.0);
    sun.position.set(3, 4, 9);
    this.scene.add(new THREE.HemisphereLight("#ffffff", "#8a929a", 2.2), sun);
    for (const part of this.view.parts) this.addPart(part);
    for (const line of this.view.lines) this.addLine(line);
    this.addSpots();
    this.addFloor();
    this.addAxes();
  }

  // Arrows x, y, z at the base, each with its letter and strokes every 100 mm; nothing hides them.
  addAxes() {
    const low = new THREE.Vector3(...this.view.low_mm), high = new THREE.Vector3(...this.view.high_mm);
    const length = Math.max(100, Math.round(0.22 * low.distanceTo(high) / 100) * 100), axes = new THREE.Group();
    for (const [name, colour, along] of AXES) {
      const direction = new THREE.Vector3(...along), aside = new THREE.Vector3(along[1] + along[2], along[0], 0);
      const arrow = new THREE.ArrowHelper(direction, new THREE.Vector3(), length, colour, 0.15 * length, 0.075 * length);
      const marks = [];
      for (let at = 100; at < length; at += 100) {
        for (const s of [-0.03 * length, 0.03 * length]) marks.push(direction.clone().multiplyScalar(at).addScaledVector(aside, s));
      }
      const strokes = new THREE.LineSegments(
        new THREE.BufferGeometry().setFromPoints(marks), new THREE.LineBasicMaterial({ color: colour }));
      const letter = letterSprite(name, colour, 0.28 * length);
      letter.position.copy(direction).multiplyScalar(1.15 * length);
      axes.add(arrow, strokes, letter);
    }
    axes.traverse((node) => { if (node.material) { node.material.depthTest = false; node.renderOrder = 4; } });
    this.scene.add(this.layer("axes x, y, z", AXES[0][1], axes));
  }

  addPart(part) {
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(unpack(part.vertices, Float32Array), 3));
    geometry.setIndex(new THREE.BufferAttribute(unpack(part.triangles, Uint32Array), 1));
    const flat = geometry.toNonIndexed();
    flat.computeVertexNormals();
    const clear = part.opacity < 1;
    const material = new THREE.MeshLambertMaterial({
      color: part.colour, transparent: clear, opacity: part.opacity, depthWrite: !clear,
      side: THREE.DoubleSide, flatShading: false,
    });
    const mesh = new THREE.Mesh(flat, material);
    (part.carrier < 0 ? this.scene : this.carriers[part.carrier]).add(this.layer(part.name, part.colour, mesh));
  }

  // Shows other bodies under the name of a layer; its switch stays.
  replaceLayer(name, parts) {
    const layer = this.layers.get(name), seen = layer?.nodes[0]?.visible ?? true;
    if (!layer) return;
    layer.nodes.forEach((n) => { n.removeFromParent(); n.geometry.dispose(); });
    layer.nodes.length = 0;
    parts.forEach((p) => this.addPart(p));
    layer.nodes.forEach((n) => { n.visible = seen; });
    this.draw();
  }

  addLine(line) {
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(unpack(line.points, Float32Array), 3));
    const colour = LINES[line.name] ?? "#3c3c3c", faint = this.view.spots.length > TANGLED;
    const material = new THREE.LineBasicMaterial({ color: colour, transparent: faint, opacity: faint ? 0.2 : 1 });
    this.scene.add(this.layer(line.name, colour, new THREE.Line(geometry, material)));
  }

  addSpots() {
    for (const [role, colour] of Object.entries(ROLES)) {
      const spots = this.view.spots.filter((s) => s.role === role);
      if (!spots.length) continue;
      const mesh = new THREE.InstancedMesh(
        new THREE.SphereGeometry(11, 12, 8), new THREE.MeshLambertMaterial({ color: colour }), spots.length);
      const matrix = new THREE.Matrix4();
      spots.forEach((s, k) => mesh.setMatrixAt(k, matrix.makeTranslation(...s.position_mm)));
      mesh.visible = role !== "validate" || spots.length <= MANY; // its switch shows them
      const name = role === "calibrate" && document.body.dataset.kind === "check-plan" ? "check" : role;
      this.scene.add(this.layer(`${name} (${spots.length})`, colour, mesh));
    }
  }

  addFloor() {
    if (this.view.floor_mm === null || this.view.floor_mm === undefined) return;
    const [low, high] = [this.view.low_mm, this.view.high_mm];
    const size = Math.ceil(Math.max(high[0] - low[0], high[1] - low[1]) / 500) * 500 + 500;
    const grid = new THREE.GridHelper(size, size / 250, "#9aa5ae", "#d3dae0");
    grid.rotation.x = Math.PI / 2;
    grid.position.set((low[0] + high[0]) / 2, (low[1] + high[1]) / 2, this.view.floor_mm);
    this.scene.add(this.layer("floor", "#d3dae0", grid));
  }

  show(frame) {
    this.frame = frame;
    this.carriers.forEach((carrier, c) => {
      const at = 12 * (frame * this.view.carriers + c), m = this.poses.subarray(at, at + 12);
      carrier.matrix.set(m[0], m[1], m[2], m[3], m[4], m[5], m[6], m[7], m[8], m[9], m[10], m[11], 0, 0, 0, 1);
      carrier.matrixWorldNeedsUpdate = true;
    });
    this.draw();
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.stage;
    if (!width || !height) return;
    this.renderer.setSize(width, height);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.draw();
  }

  draw() {
    if (this.queued || !this.renderer) return;
    this.queued = true;
    requestAnimationFrame(() => {
      this.queued = false;
      this.renderer.render(this.scene, this.camera);
    });
  }

  layerSwitches() {
    return [...this.layers].map(([name, { colour, nodes }]) => {
      const box = make("input", { type: "checkbox", checked: nodes[0].visible });
      box.addEventListener("change", () => {
        nodes.forEach((n) => { n.visible = box.checked; });
        this.draw();
      });
      const swatch = make("span", { className: "swatch" });
      swatch.style.background = colour;
      return make("label", {}, box, swatch, name);
    });
  }
}

// Shows a view in the page's stage, with its slider and the switches of what is shown.
export function showView(view) {
  const stage = document.querySelector("#view");
  let shown;
  try {
    shown = new CellView(stage, view);
  } catch (problem) {
    const said = make("p", { className: "hint waiting" }, "This browser shows no 3D (WebGL is off).");
    if (stage.querySelector("svg")) stage.after(said); else stage.replaceChildren(said); // a still picture stays
    return null;
  }
  document.querySelectorAll("[data-turn]").forEach((b) => b.addEventListener("click", () => shown.orbit.act(b.dataset.turn)));
  document.querySelector(".layers").append(...shown.layerSwitches());
  const text = document.querySelector("#frame-text");
  const tell = (k) => { text.textContent = view.labels[k] ?? ""; };
  tell(0);
  if (view.frames > 1) slide(shown, view.frames, tell);
  return shown;
}

function slide(shown, frames, tell) {
  const slider = document.querySelector("#time"), play = document.querySelector("#play");
  document.querySelector(".slider").hidden = false;
  slider.max = frames - 1;
  const go = (k) => {
    slider.value = k;
    slider.setAttribute("aria-valuetext", shown.view.labels[k]);
    tell(k);
    shown.show(k);
  };
  slider.addEventListener("input", () => go(Number(slider.value)));
  let timer = null;
  play.addEventListener("click", () => {
    if (timer) { clearInterval(timer); timer = null; } else {
      timer = setInterval(() => go((Number(slider.value) + 1) % frames), 60);
    }
    play.textContent = timer ? "Pause" : "Play";
  });
  go(0);
}
