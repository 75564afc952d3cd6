// Adds what a job has found to the record of a robot, and withdraws entries, robots and certificates with a reason.
import { dayText, find, isKnown, post, root, say, send } from "./common.js";

const FIELDS = { operator: "#operator", tool: "#tool", gauge: "#gauge", certificate: "#gauge-certificate" };

export function offerRecord(job) {
  const form = find("#record-form"), add = find("#new-robot");
  if (!form) return;
  find("#serial").addEventListener("input", (e) => {
    e.target.setCustomValidity(e.target.validity.patternMismatch ? e.target.title : "");
    add.hidden = true;
  });
  const day = find("#date");
  day.max = dayText(new Date());
  day.value ||= day.max; // a person may have been quicker than this script
  const enter = async (isNew) => {
    const serial = find("#serial").value, temperature = find("#temperature").value, message = find("#record-message");
    const path = `/api/records/${encodeURIComponent(serial)}`;
    const circumstances = { date: find("#date").value, ...(temperature && { temperature_degC: Number(temperature) }) };
    for (const [name, field] of Object.entries(FIELDS)) circumstances[name] = find(field).value.trim();
    try {
      if (!isNew && !(await isKnown(serial))) { // a mistyped serial number makes no robot without a question
        add.textContent = `${serial} is a new robot: add it`;
        add.hidden = false;
        say(message, `There is no robot ${serial} yet, or it was withdrawn.`);
        return;
      }
      await post(`${path}/entries`, { job, circumstances });
      location.href = `${root}/robots/${encodeURIComponent(serial)}`;
    } catch (problem) { say(message, problem.message, true); }
  };
  form.addEventListener("submit", (event) => { event.preventDefault(); enter(false); });
  add.addEventListener("click", () => enter(true));
}

for (const form of document.querySelectorAll("[data-withdraw]")) {
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    try {
      await send("POST", form.dataset.withdraw, { reason: form.querySelector("input").value });
      location.reload();
    } catch (problem) { say(form.querySelector("[role=status]"), problem.message, true); }
  });
}
