import { find, make, page, root, stateMark, timeText } from "./common.js";

const PLANS = ["plan", "check-plan"];
const form = find("#compare-form"), filter = find("#filter"), more = find("#more"), body = find("#jobs tbody");
let ticks = [];

// Ticked plans are the first and the second of a comparison.
function choose() {
  const chosen = ticks.filter((t) => t.checked);
  chosen.forEach((t, k) => { t.name = k ? "second" : "first"; });
  form.querySelector("button").disabled = chosen.length !== 2;
}

function tick(job) {
  if (job.state !== "done" || !PLANS.includes(job.kind)) return "";
  const box = make("input", { type: "checkbox", value: job.id, ariaLabel: `compare the plan of ${job.title}` });
  box.setAttribute("form", form.id);
  box.addEventListener("change", choose);
  ticks.push(box);
  return box;
}

const row = (j) => make("tr", {}, make("td", {}, tick(j)),
  make("th", { scope: "row" }, make("a", { href: `${root}/jobs/${j.id}` }, j.kind)),
  make("td", {}, j.title, j.serial ? make("div", { className: "hint" }, "robot ", make("a", { href: `${root}/robots/${j.serial}` }, j.serial)) : "", j.note ? make("div", { className: "hint" }, j.note) : "", j.people.length ? make("div", { className: "hint" }, `by ${j.people.join(", ")}`) : ""),
  make("td", {}, stateMark(j), j.problem ? make("div", { className: "hint" }, j.problem.detail) : ""),
  make("td", {}, timeText(j.created)));

/** The address of the list with what the form says; a day counts from its beginning here. */
function address() {
  const given = new URLSearchParams([...new FormData(filter)].filter(([, value]) => value));
  if (given.has("since")) given.set("since", new Date(`${given.get("since")}T00:00`).toISOString());
  given.set("most", "50");
  return `/api/jobs?${given}`;
}

async function show(path, first) {
  const { content, next } = await page(path);
  if (first) { body.replaceChildren(); ticks = []; }
  body.append(...content.map(row));
  more.hidden = !next;
  more.onclick = () => show(next, false);
  find("#none").hidden = body.children.length > 0;
  find("#none").textContent = new URL(path, location).searchParams.size > 1 ? "No such job." : "Nothing yet.";
  find("#jobs").hidden = body.children.length === 0;
  form.hidden = ticks.length < 2;
  choose();
}

filter.addEventListener("submit", (event) => {
  event.preventDefault();
  const given = new URLSearchParams([...new FormData(filter)].filter(([, value]) => value)); // the address can be handed on
  history.replaceState(null, "", given.size ? `?${given}` : location.pathname);
  show(address(), true);
});
for (const [name, value] of new URLSearchParams(location.search)) {
  const field = filter.elements[name];
  if (field?.type === "checkbox") field.checked = value === field.value; else if (field) field.value = value;
}
await show(address(), true);
