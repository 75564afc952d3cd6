import { find, finished, get, givenOptions, plainName, post, send, root, say, showFacts } from "./common.js";
import { FixtureEditor } from "./editor.js";
import { showView } from "./view/view3d.js";

const { cell, files } = document.body.dataset;
const request = { cell, files: files ? JSON.parse(files) : [] };
const message = find("#message");
let editor = null;

try {
  const job = await post("/api/cell-checks", request);
  if (job.state !== "done") await finished(job.id);
  const found = await get(`/api/jobs/${job.id}/result`);
  showFacts(find("#facts"), found.facts.map((f) => [f.what, f.value]));
  const shown = showView(found.view);
  if (shown && found.fixtures.length) editor = new FixtureEditor(shown, found.fixtures, request);
} catch (problem) {
  say(message, problem.message, true);
  find("#view").replaceChildren();
}

find("#naming-form")?.addEventListener("submit", async (event) => {
  event.preventDefault();
  const { title, note } = event.target.elements, said = find("#naming-message");
  try {
    const named = await send("PATCH", `/api/cells/${cell}`, { title: title.value, note: note.value });
    find("h1").textContent = named.name;
    say(said, "Saved.");
  } catch (problem) { say(said, problem.message, true); }
});

async function start(route, body) {
  const wrong = editor?.tellWrong();
  if (wrong) { wrong.focus(); return; }
  try {
    const name = `${plainName(find("h1").textContent).replace(/(_moved)?[.]toml$/, "")}_moved.toml`;
    const job = await post(`/api/${route}`, { ...(editor ? await editor.chosen(name) : request), ...body });
    location.href = `${root}/jobs/${job.id}`;
  } catch (problem) { say(message, problem.message, true); message.scrollIntoView(); }
}

find("#plan-form").addEventListener("submit", (event) => {
  event.preventDefault();
  const poses = find("#poses").value, chosen = find("#aim").value;
  const how = chosen === "pruning" ? { method: chosen } : chosen && { aim: chosen };
  const dialects = [...document.querySelectorAll("input[name=dialect]:checked")].map((i) => i.value);
  start("plans", { ...givenOptions(event.target), dialect: dialects, ...(poses && { poses: Number(poses) }), ...how });
});
find("#study").addEventListener("click", () => start("studies", {}));
