import { find, finished, get, isResult, make, post, root, say, send, stateMark, upload } from "./common.js";

const message = find("#cell-message");

async function checkCell(files) {
  let cell = null;
  const others = [];
  for (const file of files) {
    const isCell = file.name.endsWith(".toml") && (await file.slice(0, 100000).text()).includes("edbb-cell/1");
    if (isCell && !cell) cell = await upload("cells", file);
    else others.push(await upload("files", file));
  }
  if (!cell) throw new Error('none of the files has schema = "edbb-cell/1"');
  const job = await post("/api/cell-checks", { cell: cell.id, files: others });
  say(message, "The cell is being checked …");
  await finished(job.id);
  location.href = `${root}/cells/${cell.id}?check=${job.id}`;
}

find("#cell-form").addEventListener("submit", async (event) => {
  event.preventDefault();
  say(message, "Sending …");
  try { await checkCell([...find("#cell-file").files]); } catch (problem) { say(message, problem.message, true); }
});

find("#robot-form").addEventListener("submit", async (event) => {
  event.preventDefault();
  const serial = encodeURIComponent(find("#new-serial").value);
  try {
    await send("PUT", `/api/records/${serial}`, { robot: find("#new-model").value.trim() });
    location.href = `${root}/robots/${serial}`;
  } catch (problem) { say(find("#robot-message"), problem.message, true); }
});

const jobs = (await get("/api/jobs?most=60")).filter(isResult);
find("#lately-none").hidden = jobs.length > 0;
find("#lately-list").append(...jobs.slice(0, 8).map((j) => make("li", {},
  make("a", { href: `${root}/jobs/${j.id}` }, `${j.kind} of ${j.title}`), " ", stateMark(j))));
