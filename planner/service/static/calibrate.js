import { find, finished, get, post, say, showFacts, upload } from "/static/common.js";
import { lineChart } from "/static/linechart.js";

const message = find("#run-message"), sent = find("#sent"), drop = find("#drop");
let runs = [], simulation = null;

function place() {
  const plan = find("#plan").value;
  return plan ? { plan } : { cell: find("#cell").value };
}

function update() {
  const plan = find("#plan").value;
  find("#cell-choice").hidden = plan !== "";
  find("#simulate").disabled = plan === "";
  find("#identify").disabled = !runs.length && !simulation;
}

async function check() {
  update();
  find("#run-view").hidden = true;
  if (!runs.length && !simulation) return;
  say(message, "Reading the log …");
  const job = await post("/api/run-checks", { runs, simulation, ...place() });
  if (job.state !== "done") await finished(job.id);
  const found = await get(`/api/jobs/${job.id}/result`);
  say(message, found.simulated ? "This run is simulated: nobody has measured this robot." : `${found.samples} samples, ${found.kind}.`, found.simulated);
  const facts = [["samples", String(found.samples)], ["kind", found.simulated ? `${found.kind}, simulated` : found.kind], ["sessions", String(found.sessions)],
    ["plan", found.plan_id ?? "the log does not say"]];
  if (found.duration_s !== null) facts.push(["duration", `${(found.duration_s / 60).toFixed(1)} min`]);
  found.warnings.forEach((w) => facts.push(["to know", w]));
  showFacts(find("#run-facts"), facts);
  const axes = found.series.filter((s) => s.name.startsWith("axis")), others = found.series.filter((s) => !s.name.startsWith("axis"));
  const unit = found.duration_s === null ? "sample" : "time (s)";
  find("#run-chart").replaceChildren(
    ...others.map((s) => lineChart(`${s.name} (${s.unit})`, unit, found.at, [s])), lineChart("axes (deg)", unit, found.at, axes));
  find("#run-view").hidden = false;
}

async function attempt(work) {
  try { await work(); } catch (problem) { say(message, problem.message, true); }
  sent.hidden = true;
}

async function take(files) {
  runs = [];
  simulation = null;
  sent.hidden = false;
  for (const file of files) {
    say(message, `Sending ${file.name} …`);
    runs.push(await upload("runs", file, (share) => { sent.value = share; }));
  }
  sent.hidden = true;
  await check();
}

find("#run").addEventListener("change", (e) => attempt(() => take([...e.target.files])));
for (const kind of ["dragover", "dragenter"]) drop.addEventListener(kind, (e) => { e.preventDefault(); drop.classList.add("over"); });
for (const kind of ["dragleave", "drop"]) drop.addEventListener(kind, () => drop.classList.remove("over"));
drop.addEventListener("drop", (e) => { e.preventDefault(); attempt(() => take([...e.dataTransfer.files])); });
for (const id of ["#plan", "#cell"]) find(id).addEventListener("change", () => attempt(check));

find("#simulate").addEventListener("click", () => attempt(async () => {
  say(message, "Simulating a robot with drawn errors …");
  const job = await post("/api/simulations", { plan: find("#plan").value, seed: 1 });
  if (job.state !== "done") await finished(job.id);
  runs = [];
  simulation = job.id;
  await check();
}));

find("#run-form").addEventListener("submit", (event) => {
  event.preventDefault();
  attempt(async () => {
    const job = await post("/api/identifications", { runs, simulation, ...place(), no_trace: !find("#trace").checked });
    location.href = `/jobs/${job.id}`;
  });
});
update();
