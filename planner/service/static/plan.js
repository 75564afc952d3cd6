import { find, finished, get, make, post, root, say } from "./common.js";
import { watchJob } from "./progress.js";

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
  // The report's still picture stands there first: without a graphics card the view takes seconds.
  const turn = find("#turn");
  if (turn) turn.addEventListener("click", turnView, { once: true });
  else turnView();
}

async function turnView() {
  const wait = (text) => find("#view").replaceChildren(make("p", { className: "hint waiting" }, text));
  find("#turn")?.parentElement.remove();
  wait("The view is being made …");
  try {
    const made = await post("/api/plan-views", { plan: job });
    if (made.state !== "done") await finished(made.id);
    const { showView } = await import("./view/view3d.js");
    find(".view .controls").hidden = false;
    showView(await get(`/api/jobs/${made.id}/result`));
  } catch (problem) { wait(problem.message); }
}
