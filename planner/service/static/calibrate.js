import { find, finished, get, givenOptions, make, ownCell, post, root, say, showFacts, tracked, upload } from "./common.js";
import { lineChart } from "./linechart.js";

const message = find("#run-message"), sent = find("#sent"), drop = find("#drop");
let runs = [], simulation = null, good = false, asked = 0, unknown = "", before = [], own = null, validation = null, sending = null;

/** Take the folder of a plan: plan, cell, and the files that cell and robot name. It is one of the plans here from now on. */
async function takePlan(files) {
  const inFolder = (file) => file.webkitRelativePath.split("/").slice(1).join("/");
  const plan = files.find((f) => inFolder(f) === "plan.json");
  if (!plan) throw new Error("this folder has no plan.json");
  const { cell, plan_id } = JSON.parse(await plan.text()), sent = [];
  const texts = await Promise.all(files.filter((f) => /\.(toml|urdf|xml)$/i.test(f.name)).map((f) => f.text()));
  const needed = (f) => ["plan.json", "cell.toml"].includes(inFolder(f)) || texts.some((text) => text.includes(f.name));
  for (const file of files.filter(needed)) sent.push({ ...await upload("files", file), name: inFolder(file) });
  const made = await post("/api/plan-uploads", { files: sent, title: String(cell ?? "") });
  const job = made.state === "done" ? made : await finished(made.id), plans = find("#plan");
  const known = [...plans.options].find((o) => o.value === job.id) ?? plans.appendChild(make("option", { value: job.id }, job.title));
  known.dataset.plan = plan_id;
  plans.value = job.id;
  say(find("#plan-message"), "");
  find("#plan-message").replaceChildren("It is taken: ", make("a", { href: `${root}/jobs/${job.id}` }, "its page"), " has checklist and programs.");
}

// what was sent stays where it is: a page that is loaded again goes on with it
function keep() { history.replaceState(null, "", `${location.search}#${encodeURIComponent(JSON.stringify({ runs, simulation, own, validation, plan: find("#plan").value, cell: find("#cell").value }))}`); }

function place() {
  const plan = find("#plan").value, cell = find("#cell");
  if (!plan && own) return own;
  return plan ? { plan } : { cell: cell.value, files: JSON.parse(cell.selectedOptions[0].dataset.files ?? "[]") };
}

const isCheck = () => "check" in find("#plan").selectedOptions[0].dataset;

function update() {
  const plan = find("#plan").value, check = isCheck(), { baseline } = find("#plan").selectedOptions[0].dataset;
  find("#cell-choice").hidden = plan !== "";
  find("#check-choice").hidden = !check;
  find("#trace-choice").hidden = check;
  find("#identify-choice").hidden = check;
  find("#change-choice").hidden = !check;
  if (baseline) find("#baseline").href = `${root}/jobs/${baseline}`; else find("#baseline").removeAttribute("href");
  find("#simulate").disabled = plan === "";
  find("#identify").disabled = !good;
  find("#identify").textContent = check ? "3. Judge the check" : "3. Identify the robot";
}

// Choose the plan that a log names, or else offer first the cells of its robot whose gauge gives such columns, and
// choose where there is one: they stand at its head, in Parquet at its end.
async function choosePlan(file) {
  const text = (await Promise.all([file.slice(0, 65536), file.slice(-65536)].map((part) => part.text()))).join("\n");
  const plan = text.match(/plan_id\W+([0-9a-f]{12})\b/)?.[1], robot = text.match(/^# robot: ([a-z0-9-]+)/m)?.[1];
  const mine = [...find("#plan").options].find((o) => plan && o.dataset.plan === plan);
  const table = text.replace(/^#.*$/gm, ""), known = (column) => new RegExp(`\\b${column}\\b`).test(table);
  const fits = (o) => o.value.startsWith(`${robot}/`) && o.dataset.columns.split(", ").every(known);
  const cells = [...find("#cell").options].filter((o) => o.dataset.columns && fits(o));
  unknown = plan && !mine ? plan : "";
  if (mine) find("#plan").value = mine.value;
  else if (plan) { find("#plan").value = ""; find("#cell").value = ""; }
  find("#fitting").append(...cells);
  find("#fitting").hidden = !find("#fitting").children.length;
  if (!plan && cells.length === 1 && !find("#cell").value) find("#cell").value = cells[0].value;
}

async function fileOf(simulation) {
  const file = (await get(`/api/jobs/${simulation}`)).files.find((f) => f.name === "run.csv");
  return { id: file.sha256, name: file.name };
}

// The runs that a plan was made after, each with its own plan: their calibration was asked for with one for each.
async function runsBefore(plan) {
  const after = plan && (await get(`/api/jobs/${plan}`)).request.after;
  if (!after) return [];
  const found = (await get(`/api/jobs/${after}`)).request, plans = [found.plan, ...(found.plans ?? [])];
  const measured = [...(found.runs ?? []), ...(found.simulation ? [await fileOf(found.simulation)] : [])];
  return measured.length === plans.length && plans.every(Boolean) ? measured.map((run, k) => ({ run, plan: plans[k] })) : [];
}

async function offerRunsBefore() {
  const plan = find("#plan").value, found = await runsBefore(plan);
  if (plan !== find("#plan").value) return;
  before = found;
  find("#before-choice").hidden = !before.length;
  find("#before-runs").textContent = before.map(({ run }) => run.name).join(", ");
}

async function check() {
  await offerRunsBefore();
  const number = ++asked;
  good = false;
  update();
  find("#run-view").hidden = true;
  if (!runs.length && !simulation) return;
  if (!find("#plan").value && !find("#cell").value && !own) {
    say(message, unknown ? `The log is of the plan ${unknown}, which is not known here: choose the cell in which it was measured.` : "The log names no plan: choose the plan, or the cell.", true);
    return;
  }
  say(message, "Reading the log …");
  const job = await post("/api/run-checks", { runs, simulation, ...place() });
  if (job.state !== "done") await finished(job.id);
  const found = await get(`/api/jobs/${job.id}/result`);
  if (number !== asked) return;
  good = true;
  update();
  keep();
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

async function attempt(work, place = message) {
  try { await work(); } catch (problem) { say(place, problem.message, true); }
  sent.hidden = true;
}

async function take(files) {
  runs = [];
  simulation = null;
  good = false;
  asked += 1;
  update();
  sent.hidden = false;
  if (files.length) await choosePlan(files[0]);
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
for (const id of ["#plan", "#cell"]) find(id).addEventListener("change", () => attempt(async () => {
  const robot = id === "#cell" && find(id).value.match(/^robot:(.*)/)?.[1];
  own = robot ? { cell: (await upload("cells", tracked(robot))).id, files: [] } : null;
  await check();
}));
find("#own-files").addEventListener("change", (e) => attempt(async () => {
  own = e.target.files.length ? await ownCell([...e.target.files]) : null;
  say(find("#own-message"), own ? "It is taken for the cell." : "");
  await check();
}, find("#own-message")));
find("#made-elsewhere").addEventListener("change", (e) => attempt(async () => {
  if (e.target.files.length) await takePlan([...e.target.files]);
  await check();
}, find("#plan-message")));
find("#validation").addEventListener("change", (e) => attempt(async () => {
  sending = e.target.files.length ? upload("runs", e.target.files[0]) : null;
  validation = await sending;
  keep();
}));

find("#simulate").addEventListener("click", () => attempt(async () => {
  const ofCheck = isCheck(), key = ofCheck && find("#change").value;
  say(message, ofCheck ? "Simulating the robot of the calibration …" : "Simulating a robot with drawn errors …");
  const change = key ? { change: `${key}=${Number(find("#change-size").value)}` } : {};
  const job = await post("/api/simulations", { plan: find("#plan").value, seed: ofCheck ? 2 : 1, ...change });
  if (job.state !== "done") await finished(job.id);
  runs = [];
  simulation = job.id;
  await check();
}));

async function judge() {
  const limit = find("#check-limit").value;
  const run = simulation ? await fileOf(simulation) : runs[0];
  const job = await post("/api/checks", { plan: find("#plan").value, run, ...(limit && { limit_mm: Number(limit) }) });
  location.href = `${root}/jobs/${job.id}`;
}

// All runs so far, each a session with its plan; files of one name get names of their own.
async function withRunsBefore() {
  const now = simulation ? [await fileOf(simulation)] : runs, plan = find("#plan").value;
  const all = [...before, ...now.map((run) => ({ run, plan }))];
  const [first, ...others] = all.map((each) => each.plan);
  return { runs: all.map(({ run }, k) => ({ id: run.id, name: `session-${k + 1}-${run.name.replace(/^session-\d+-/, "")}` })), plan: first, plans: others };
}

find("#run-form").addEventListener("submit", (event) => {
  event.preventDefault();
  attempt(async () => {
    if (isCheck()) { await judge(); return; }
    const measured = before.length && find("#before").checked ? await withRunsBefore() : { runs, simulation, ...place() };
    const apart = await (sending ?? validation); // what still goes, or failed, is not left out
    const options = { ...givenOptions(find("#identify-choice")), ...(apart && { validate_with: apart }) };
    const job = await post("/api/identifications", { ...measured, ...options, no_trace: !find("#trace").checked });
    location.href = `${root}/jobs/${job.id}`;
  });
});
update();
if (location.hash.length > 1) {
  attempt(async () => {
    const kept = JSON.parse(decodeURIComponent(location.hash.slice(1)));
    ({ runs, simulation, own, validation } = kept);
    find("#plan").value = kept.plan;
    find("#cell").value = kept.cell;
    if (validation) find("label[for=validation]").append(` (${validation.name} was sent)`);
    await check();
  });
} else if (find("#plan").value) attempt(offerRunsBefore);
