import { find, get, make, timeText } from "/static/common.js";

const PLANS = ["plan", "check-plan"];
const jobs = (await get("/api/jobs?most=300")).filter((j) => !j.kind.endsWith("-view"));
const form = find("#compare-form"), ticks = [];

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

find("#none").hidden = jobs.length > 0;
find("#jobs").hidden = jobs.length === 0;
find("#jobs tbody").append(...jobs.map((j) => make("tr", {}, make("td", {}, tick(j)),
  make("th", { scope: "row" }, make("a", { href: `/jobs/${j.id}` }, j.kind)), make("td", {}, j.title),
  make("td", {}, make("span", { className: `state ${j.state}` }, j.state), j.problem ? make("div", { className: "hint" }, j.problem.detail) : ""),
  make("td", {}, timeText(j.created)))));
form.hidden = ticks.length < 2;
choose();
