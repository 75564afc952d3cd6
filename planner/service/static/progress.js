// Shows how far the job of a page is; when it ends the page is loaded again, with the result.
import { find, follow, get, make, post, say } from "./common.js";

const ORDINALS = { one: "st", two: "nd", few: "rd", other: "th" };
const ordinal = (n) => `${n}${ORDINALS[new Intl.PluralRules("en", { type: "ordinal" }).select(n)]}`;
const inWords = (s) => s > 90 ? `${Math.round(s / 60)} min` : `${Math.max(5, 5 * Math.round(s / 5))} s`;

/** Place in the queue and time left, as far as like jobs tell. */
export function outlookText(job) {
  const place = job.position ? `${ordinal(job.position)} of those that wait` : "";
  if (job.left_s === null || job.left_s === undefined) return place;
  const left = job.left_s > 0 ? `about ${inWords(job.left_s)} left` : "longer than others of its kind";
  return place ? `${place}, ${left}` : left;
}

async function tellLeft(job) {
  const found = await get(`/api/jobs/${job}`).catch(() => null);
  if (found) find("#left").textContent = outlookText(found);
}

export function watchJob() {
  const { job, state } = document.body.dataset;
  if (!["queued", "running"].includes(state)) return;
  const stages = find("#stages"), bar = find("#bar");
  let last = "";
  tellLeft(job);
  setInterval(() => tellLeft(job), 5000);
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
