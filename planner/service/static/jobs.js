import { find, get, make, timeText } from "/static/common.js";

const jobs = (await get("/api/jobs?most=300")).filter((j) => !j.kind.endsWith("-view"));
find("#none").hidden = jobs.length > 0;
find("#jobs").hidden = jobs.length === 0;
find("#jobs tbody").append(...jobs.map((j) => make("tr", {},
  make("th", { scope: "row" }, make("a", { href: `/jobs/${j.id}` }, j.kind)), make("td", {}, j.title),
  make("td", {}, make("span", { className: `state ${j.state}` }, j.state), j.problem ? make("div", { className: "hint" }, j.problem.detail) : ""),
  make("td", {}, timeText(j.created)))));
