// Begins the session of a robot; a serial number that nobody knows makes a robot only after a question.
import { find, isKnown, post, root, say, send } from "./common.js";

const { job, robot } = document.body.dataset, message = find("#session-message"), add = find("#new-robot");
const serial = () => find("#serial").value;
const begin = async () => { location.href = root + (await post("/api/sessions", { plan: job, serial: serial() })).url; };

async function beginOrAsk() {
  add.hidden = await isKnown(serial());
  if (add.hidden) { await begin(); return; }
  say(message, `There is no robot ${serial()} yet, or it was withdrawn.`);
  add.textContent = `${serial()} is a new robot: add it`;
}

async function attempt(act) {
  try { await act(); } catch (problem) { say(message, problem.message, true); }
}

find("#session-form").addEventListener("submit", (event) => { event.preventDefault(); attempt(beginOrAsk); });
find("#serial").addEventListener("input", () => { add.hidden = true; say(message, ""); });
add.addEventListener("click", () => attempt(async () => {
  await send("PUT", `/api/records/${encodeURIComponent(serial())}`, { robot });
  await begin();
}));
