// Sends a program with its files, and leads to what came of it.
import { find, givenOptions, ownCell, post, root, say, upload } from "./common.js";

find("#correct-form").addEventListener("submit", async (event) => {
  event.preventDefault();
  const message = find("#correct-message"), [frames] = find("#frames").files, cell = find("#cell").files;
  say(message, "Sending …");
  try {
    const [program, ...files] = await Promise.all([...find("#program").files].map((file) => upload("files", file)));
    const asked = { program, files, model: document.body.dataset.job, ...givenOptions(find("#correct-form")) };
    if (frames) asked.frames = await upload("files", frames);
    if (cell.length) {
      const own = await ownCell([...cell]);
      Object.assign(asked, { cell: own.cell, files: [...files, ...own.files] });
    }
    location.href = `${root}/jobs/${(await post("/api/compensations", asked)).id}`;
  } catch (problem) { say(message, problem.message, true); }
});
