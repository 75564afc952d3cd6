// Turns a camera about a point by mouse, fingers and keys.
import * as THREE from "./three/three.module.min.js";

const KEYS = {
  ArrowLeft: [-0.12, 0, 1], ArrowRight: [0.12, 0, 1], ArrowUp: [0, 0.1, 1], ArrowDown: [0, -0.1, 1],
  "+": [0, 0, 0.85], "=": [0, 0, 0.85], "-": [0, 0, 1.18],
};

export class Orbit {
  constructor(stage, camera, low, high, changed) {
    Object.assign(this, { stage, camera, low, high, changed });
    this.pointers = new Map();
    this.reset();
    stage.addEventListener("pointerdown", (e) => { stage.setPointerCapture(e.pointerId); this.pointers.set(e.pointerId, e); });
    for (const end of ["pointerup", "pointercancel"]) stage.addEventListener(end, (e) => this.pointers.delete(e.pointerId));
    stage.addEventListener("pointermove", (e) => this.drag(e));
    stage.addEventListener("wheel", (e) => this.turnWheel(e), { passive: false });
    stage.addEventListener("contextmenu", (e) => e.preventDefault());
    stage.addEventListener("keydown", (e) => this.press(e));
  }

  // The wheel scrolls the page, as everywhere; with Ctrl (which a pinch on a touchpad sends too) it comes closer.
  turnWheel(event) {
    if (!event.ctrlKey && !event.metaKey) { this.tellWheel(); return; }
    event.preventDefault();
    this.move(0, 0, Math.exp(event.deltaY * (Math.abs(event.deltaY) < 20 ? 0.01 : 0.001)));
  }

  tellWheel() {
    this.note ??= this.stage.parentElement.querySelector(".wheel-note");
    if (!this.note) return;
    this.note.hidden = false;
    clearTimeout(this.noted);
    this.noted = setTimeout(() => { this.note.hidden = true; }, 1500);
  }

  /** Do what a key does, for the buttons below the view. */
  act(key) {
    if (key === "0") this.reset(); else this.move(...KEYS[key]);
  }

  reset() {
    this.target = this.low.clone().add(this.high).multiplyScalar(0.5);
    this.distance = 1.05 * this.low.distanceTo(this.high);
    this.around = 0.75;
    this.above = 0.42;
    this.move(0, 0, 1);
  }

  press(event) {
    if (event.key !== "0" && !(event.key in KEYS)) return;
    this.act(event.key);
    event.preventDefault();
  }

  drag(event) {
    const before = this.pointers.get(event.pointerId);
    if (!before) return;
    const dx = event.clientX - before.clientX, dy = event.clientY - before.clientY;
    const others = [...this.pointers.values()].filter((p) => p.pointerId !== event.pointerId);
    this.pointers.set(event.pointerId, event);
    if (others.length) {
      const span = (p) => Math.hypot(p.clientX - others[0].clientX, p.clientY - others[0].clientY);
      this.shift(dx / 2, dy / 2);
      this.move(0, 0, span(before) / Math.max(1, span(event)));
    } else if (event.buttons & 2 || event.shiftKey) this.shift(dx, dy);
    else this.move(-dx * 0.007, dy * 0.007, 1);
  }

  shift(dx, dy) {
    const size = 1.4 * this.distance / this.stage.clientHeight * 0.5;
    const right = new THREE.Vector3().setFromMatrixColumn(this.camera.matrix, 0);
    const up = new THREE.Vector3().setFromMatrixColumn(this.camera.matrix, 1);
    this.target.addScaledVector(right, -dx * size).addScaledVector(up, dy * size);
    this.move(0, 0, 1);
  }

  move(around, above, scale) {
    this.around += around;
    this.above = Math.min(1.5, Math.max(-0.6, this.above + above));
    this.distance = Math.min(40000, Math.max(60, this.distance * scale));
    const level = Math.cos(this.above) * this.distance;
    this.camera.position.set(
      this.target.x + level * Math.cos(this.around), this.target.y + level * Math.sin(this.around),
      this.target.z + Math.sin(this.above) * this.distance);
    this.camera.lookAt(this.target);
    this.camera.updateMatrix();
    this.changed();
  }
}
