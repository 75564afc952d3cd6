import { find, get, post, root, say, upload } from "./common.js";
import { watchJob } from "./progress.js";
import { offerRecord } from "./record.js";

const { job } = document.body.dataset;
watchJob();

offerRecord(job);
addEventListener("beforeprint", () => document.querySelector("#report")?.shadowRoot.querySelectorAll("details").forEach((d) => { d.open = true; }));

find("#validate-form")?.addEventListener("submit", async (event) => {
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
