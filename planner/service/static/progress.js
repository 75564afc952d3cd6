// Shows how far the job of a page is; when it ends the page is loaded again, with the result.
import { find, follow, make, post, say } from "/static/common.js";

export function watchJob() {
  const { job, state } = document.body.dataset;
  if (!["queued", "running"].includes(state)) return;
  const stages = find("#stages"), bar = find("#bar");
  let last = "";
  follow(job, (kind, data) => {
    if (kind === "end") { location.reload(); return; }
    say(find("#state"), kind === "queued" ? "waiting" : "running");
    if (kind === "queued") { stages.replaceChildren(); last = ""; }
    if (kind !== "progress") return;
    if (data.stage !== last) {
      stages.querySelectorAll(".now").forEach((n) => n.classList.remove("now"));
      stages.append(make("li", { className: "now" }, data.stage));
      last = data.stage;
    }
    find("#stage").textContent = data.of ? `${data.stage}: ${data.done} of ${data.of}` : data.stage;
    if (data.of) { bar.max = data.of; bar.value = data.done; } else bar.removeAttribute("value");
  });
  find("#cancel").addEventListener("click", async (e) => {
    e.target.disabled = true;
    await post(`/api/jobs/${job}/cancel`);
  });
}
