// Name, note, archive and deletion of a job.
import { find, root, say, send } from "./common.js";

const form = find("#keeping-form"), message = find("#keeping-message"), { job } = document.body.dataset;

async function change(act, told) {
  try { await act(); say(message, told); return true; } catch (problem) { say(message, problem.message, true); return false; }
}

form?.addEventListener("submit", (event) => {
  event.preventDefault();
  const { title, note, archived } = form.elements;
  change(() => send("PATCH", `/api/jobs/${job}`, { title: title.value, note: note.value, archived: archived.checked }), "Saved.");
});

// deleted only when pressed a second time: there is no way back
find("#delete")?.addEventListener("click", async (event) => {
  if (event.target.dataset.sure !== "yes") {
    event.target.dataset.sure = "yes";
    event.target.textContent = "Delete for good";
    say(message, "Its files go with it. Press again to delete.");
    return;
  }
  if (await change(() => send("DELETE", `/api/jobs/${job}`), "Deleted.")) location.href = `${root}/jobs`;
});
