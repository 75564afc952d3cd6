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
  find("#correct-form").addEventListener("submit", async (event) => {
    event.preventDefault();
    const message = find("#correct-message"), result = find("#correct-result");
    result.replaceChildren();
    say(message, "Correcting …");
    try {
      const [program, ...files] = await Promise.all([...find("#program").files].map((file) => upload("files", file)));
      const made = await post("/api/compensations", { program, files, model: job });
      const done = made.state === "done" ? await get(made.url) : await finished(made.id);
      const names = [program, ...files].map((file) => file.name);
      const log = done.files.find((f) => f.name === "log");
      say(message, done.exit_code === 5 ? "Corrected in part; the head of the file lists what was left as it was." : "Corrected.");
      for (const file of done.files.filter((f) => names.includes(f.name)))
        result.append(make("a", { href: root + file.url, download: file.name }, `corrected ${file.name}`), " ");
      if (log) result.append(" ", make("a", { href: root + log.url, download: "log.txt" }, "log"));
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
