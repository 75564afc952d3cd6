// The fixture of a cell, dragged in the 3D view or set by its coordinates; what is reached from there follows.
import * as THREE from "./view/three/three.module.min.js";
import { find, finished, get, make, post, reach, root, say, showFacts } from "./common.js";

const AXES = ["x", "y", "z"], PAUSE_MS = 350, REACH = "reach of the gauge";

// A ball to be dragged level, and an arrow to be dragged up and down.
function buildHandle() {
  const look = new THREE.MeshStandardMaterial({ color: "#d97a00", depthTest: false, transparent: true, opacity: 0.85 });
  const part = (geometry, name, z) => {
    const mesh = new THREE.Mesh(geometry, look);
    Object.assign(mesh, { name, renderOrder: 5 });
    mesh.position.z = z;
    return mesh;
  };
  const turned = (geometry) => geometry.rotateX(Math.PI / 2);
  const handle = new THREE.Group();
  handle.add(part(new THREE.SphereGeometry(42, 20, 14), "level", 0),
    part(turned(new THREE.CylinderGeometry(9, 9, 150)), "upright", 115), part(turned(new THREE.ConeGeometry(30, 70)), "upright", 220));
  return handle;
}

export class FixtureEditor {
  constructor(view, fixtures, request) {
    Object.assign(this, { view, fixtures, request, which: 0, wanted: 0, moved: null });
    this.places = fixtures.map((f) => new THREE.Vector3(...f.position_mm));
    this.handle = buildHandle();
    view.scene.add(this.handle);
    this.inputs = AXES.map((a) => find(`#fixture-${a}`));
    this.inputs.forEach((input) => input.addEventListener("input", () => {
      if (!this.tellWrong()) this.moveTo(new THREE.Vector3(...this.inputs.map((i) => Number(i.value))));
    }));
    const choice = find("#fixture-which");
    choice.append(...fixtures.map((f, k) => make("option", { value: k }, f.name)));
    choice.closest("p").hidden = fixtures.length < 2;
    choice.addEventListener("change", () => { this.putBack(); this.which = Number(choice.value); this.putBack(); this.ask(); });
    find("#fixture-back").addEventListener("click", () => { this.putBack(); this.ask(); });
    // before the view's own turning hears of it
    view.stage.addEventListener("pointerdown", (e) => this.grab(e), true);
    view.stage.addEventListener("pointermove", (e) => this.drag(e), true);
    view.stage.addEventListener("touchstart", (e) => { if (this.held) e.preventDefault(); }, { passive: false }); // no scrolling
    for (const end of ["pointerup", "pointercancel"]) view.stage.addEventListener(end, (e) => this.release(e), true);
    find("#fixture-card").hidden = false;
    this.putBack();
    this.ask();
  }

  // Says which coordinate is no number that is allowed, and returns its field.
  tellWrong() {
    const bad = (i) => i.validity.valueMissing || i.validity.badInput || i.validity.rangeUnderflow || i.validity.rangeOverflow;
    const wrong = this.inputs.filter(bad), names = wrong.map((i) => i.id.slice(-1)).join(", ");
    this.inputs.forEach((i) => { if (bad(i)) i.setAttribute("aria-invalid", "true"); else i.removeAttribute("aria-invalid"); });
    say(find("#fixture-wrong"), wrong.length ? `${names}: give a number from ${this.inputs[0].min} to ${this.inputs[0].max} mm. Nothing is planned before.` : "", wrong.length > 0);
    return wrong[0];
  }

  get start() { return this.places[this.which]; }
  putBack() { this.place(this.start); }

  ray(event) {
    const box = this.view.stage.getBoundingClientRect(), caster = new THREE.Raycaster();
    caster.setFromCamera(new THREE.Vector2(
      2 * (event.clientX - box.left) / box.width - 1, 1 - 2 * (event.clientY - box.top) / box.height), this.view.camera);
    return caster;
  }

  grab(event) {
    const [hit] = this.ray(event).intersectObject(this.handle);
    if (!hit || event.button > 0) return;
    const normal = new THREE.Vector3(0, 0, 1);
    if (hit.object.name === "upright") this.view.camera.getWorldDirection(normal).setZ(0).normalize();
    this.held = { upright: hit.object.name === "upright", at: this.handle.position.clone(), from: hit.point.clone(),
      plane: new THREE.Plane().setFromNormalAndCoplanarPoint(normal, hit.point) };
    this.view.stage.setPointerCapture(event.pointerId);
    event.stopPropagation();
  }

  drag(event) {
    if (!this.held) return;
    event.stopPropagation();
    const { upright, at, from, plane } = this.held, hit = this.ray(event).ray.intersectPlane(plane, new THREE.Vector3());
    if (!hit) return;
    const step = hit.sub(from);
    if (upright) step.set(0, 0, step.z); else step.z = 0;
    this.moveTo(at.clone().add(step).round());
  }

  release(event) {
    if (!this.held) return;
    this.held = null;
    event.stopPropagation();
  }

  place(position) {
    this.handle.position.copy(position);
    this.inputs.forEach((input, k) => { if (Number(input.value) !== position.getComponent(k) || input.value === "") input.value = position.getComponent(k); });
    this.tellWrong();
    this.tellDistances(position);
    const shells = this.view.layers.get(REACH)?.nodes ?? [], each = shells.length / this.fixtures.length;
    shells.forEach((n, k) => n.position.copy(Math.floor(k / each) === this.which ? position.clone().sub(this.start) : new THREE.Vector3()));
    this.view.draw();
  }

  // How far the fixture stands from the robot's base, and how far it was moved.
  tellDistances(p) {
    const moved = p.distanceTo(this.start), mm = (v) => `${Math.round(v)} mm`;
    const height = `${mm(Math.abs(p.z))} ${p.z < 0 ? "below" : "above"} its base`;
    const step = moved < 0.5 ? "" : `; moved by ${mm(moved)} (${AXES.map((a, k) => `${a} ${Math.round(p.getComponent(k) - this.start.getComponent(k))}`).join(", ")})`;
    find("#fixture-distances").textContent = `${mm(Math.hypot(p.x, p.y))} from the robot's first axis, ${height}${step}`;
  }

  moveTo(position) {
    this.place(position);
    clearTimeout(this.timer);
    say(find("#fixture-problem"), "");
    this.timer = setTimeout(() => this.ask(), PAUSE_MS);
  }

  // What is to be expected of the place; an earlier question that is still open is dropped.
  ask() {
    clearTimeout(this.timer);
    const place = JSON.stringify([this.which, ...this.handle.position.toArray()]);
    if (place === this.asked) return; // the same question would be the same job: its answer comes, it is not cancelled
    this.asked = place;
    const number = ++this.wanted, position_mm = this.handle.position.toArray(), away = !this.handle.position.equals(this.start);
    find("#fixture-facts").setAttribute("aria-busy", "true");
    if (this.open) post(`/api/jobs/${this.open}/cancel`).catch(() => {});
    this.answer = this.foresee(number, { ...this.request, fixture: this.which, position_mm }, away);
    this.answer.catch((problem) => {
      if (number !== this.wanted) return;
      this.asked = null;
      say(find("#fixture-wait"), "");
      say(find("#fixture-problem"), problem.message, true);
    });
  }

  async foresee(number, body, away) {
    const job = await post("/api/fixture-views", body);
    if (number === this.wanted) this.open = job.id;
    if (job.state !== "done") await finished(job.id, (kind) => { if (number === this.wanted) this.sayWaiting(kind); }).finally(() => { if (this.open === job.id) this.open = null; });
    const found = await get(`/api/jobs/${job.id}/result`);
    if (number !== this.wanted) return null;
    if (!away) this.before = found;
    this.moved = away ? job.id : null;
    this.show(found);
    return job.id;
  }

  sayWaiting(kind) {
    const why = kind === "queued" ? "Waiting for what runs (plans, other pages) …" : "Computing …";
    say(find("#fixture-wait"), `${why}${this.before ? " The figures are of the place before." : ""}`);
  }

  show(found) {
    say(find("#fixture-wait"), "");
    const text = (value, was, digits) => value === null ? "—" : `${value.toPrecision(digits)}${was && was !== value ? ` (was ${was.toPrecision(digits)})` : ""}`;
    find("#fixture-reach").textContent = `${text(100 * found.share, this.before && 100 * this.before.share, 3)} % of the arm's states`;
    find("#fixture-error").textContent = found.error_mm === null ? "—"
      : `${text(found.error_mm, this.before?.error_mm, 3)} mm after ${found.poses} poses; uncalibrated ${found.before_mm.toPrecision(3)} mm`;
    find("#fixture-facts").removeAttribute("aria-busy");
    say(find("#fixture-problem"), found.problem, found.problem !== "");
    find("#fixture-file").hidden = this.moved === null;
    if (this.moved) find("#fixture-file").href = `${root}/api/jobs/${this.moved}/files/cell.toml`;
    showFacts(find("#facts"), found.check.facts.map((f) => [f.what, f.value]));
    this.view.replaceLayer("obstacles", found.check.view.parts.filter((p) => p.name === "obstacles"));
  }

  // The request for what is planned: the cell as it is, or, sent there as a file of its own, as it was moved.
  async chosen(name) {
    clearTimeout(this.timer);
    if (this.handle.position.equals(this.start)) return this.request;
    this.ask();
    const job = await this.answer, text = await get(`/api/jobs/${job}/files/cell.toml`);
    const answer = await reach(`/api/cells?name=${encodeURIComponent(name)}`, { method: "POST", body: text });
    if (!answer.ok) throw new Error("the moved cell was not taken");
    return { ...this.request, cell: (await answer.json()).id };
  }
}
