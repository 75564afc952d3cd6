import { find, finished, get, make, post, root, say } from "./common.js";
import { watchJob } from "./progress.js";
import { showView } from "./view/view3d.js";

const { job, state } = document.body.dataset;
watchJob();

if (state === "done") {
  find("#export-form")?.addEventListener("submit", async (event) => {
    event.preventDefault();
    const message = find("#export-message");
    say(message, "Writing …");
    try {
      const made = await post("/api/exports", { plan: job, dialect: find("#dialect").value });
      const done = made.state === "done" ? await get(made.url) : await finished(made.id);
      const files = done.files.filter((f) => !["log", "printed"].includes(f.name));
      message.replaceChildren(...files.flatMap((f) => [make("a", { href: root + f.url, download: f.name }, f.name), " "]));
    } catch (problem) { say(message, problem.message, true); }
  });
  try {
    const made = await post("/api/plan-views", { plan: job });
    if (made.state !== "done") await finished(made.id);
    showView(await get(`/api/jobs/${made.id}/result`));
  } catch (problem) {
    find("#view").replaceChildren(make("p", { className: "hint waiting" }, problem.message));
  }
}
