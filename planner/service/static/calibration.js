import { find, finished, get, make, post, root, say, upload } from "./common.js";
import { watchJob } from "./progress.js";
import { offerRecord } from "./record.js";
import { showView } from "./view/view3d.js";

const { job, state } = document.body.dataset;
watchJob();

function showLegend(view, shown) {
  const { what, unit, layers, most } = view.cloud, choice = find("#layer");
  choice.append(...layers.map((l, k) => make("option", { value: k }, `${l.name}: ${l.rms.toFixed(4)} ${unit} rms`)));
  choice.addEventListener("change", () => shown.colour(Number(choice.value)));
  find("#scale-text").textContent = `${what}: from 0 (blue) to ${most.toPrecision(2)} ${unit} and more (red)`;
  find("#map-choice").hidden = false;
}

async function showMap() {
  try {
    const made = await post("/api/error-maps", { model: job });
    if (made.state !== "done") await finished(made.id);
    const view = await get(`/api/jobs/${made.id}/result`);
    const shown = showView(view);
    if (shown) showLegend(view, shown);
  } catch (problem) {
    find("#view").replaceChildren(make("p", { className: "hint waiting" }, problem.message));
  }
}

offerRecord(job);
if (state === "done") {
  showMap();
  find("#validate-form").addEventListener("submit", async (event) => {
    event.preventDefault();
    const message = find("#validate-message");
    say(message, "Sending …");
    try {
      const run = await upload("runs", find("#validation-run").files[0]), { request } = await get(`/api/jobs/${job}`);
      const { plan, cell, files } = request;
      const made = await post("/api/validations", { runs: [run], model: job, ...(plan && { plan }), ...(cell && { cell, files }) });
      location.href = `${root}/jobs/${made.id}`;
    } catch (problem) { say(message, problem.message, true); }
  });
}

find("#check-plan-form")?.addEventListener("submit", async (event) => {
  event.preventDefault();
  const message = find("#check-message");
  try {
    say(message, "Sending …");
    location.href = `${root}/jobs/${(await post("/api/check-plans", { model: job, poses: Number(find("#check-poses").value) })).id}`;
  } catch (problem) { say(message, problem.message, true); }
});

find("#next-form")?.addEventListener("submit", async (event) => {
  event.preventDefault();
  const message = find("#next-message"), until = find("#until").value;
  const asked = { after: job, same_mounting: find("#standing").checked, ...(until && { until_mm: Number(until) }) };
  try {
    say(message, "Sending …");
    location.href = `${root}/jobs/${(await post("/api/plans", asked)).id}`;
  } catch (problem) { say(message, problem.message, true); }
});
