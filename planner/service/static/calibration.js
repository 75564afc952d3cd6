import { find, finished, get, make, post, say, upload } from "/static/common.js";
import { watchJob } from "/static/progress.js";

const { job, state } = document.body.dataset;
watchJob();

if (state === "done") {
  find("#correct-form").addEventListener("submit", async (event) => {
    event.preventDefault();
    const message = find("#correct-message"), result = find("#correct-result");
    result.replaceChildren();
    say(message, "Correcting …");
    try {
      const program = await upload("files", find("#program").files[0]);
      const made = await post("/api/compensations", { program, model: job });
      const done = made.state === "done" ? await get(made.url) : await finished(made.id);
      const file = done.files.find((f) => f.name === program.name);
      const log = done.files.find((f) => f.name === "log");
      say(message, done.exit_code === 5 ? "Corrected in part; the log lists what was left as it was." : "Corrected.");
      result.append(make("a", { href: file.url, download: `corrected_${program.name}` }, `corrected ${program.name}`));
      if (log) result.append(" ", make("a", { href: log.url, download: "log.txt" }, "log"));
    } catch (problem) { say(message, problem.message, true); }
  });
}
