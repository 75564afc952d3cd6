// Adds what a job has found to the record of a robot.
import { find, post, root, say } from "./common.js";

const FIELDS = { operator: "#operator", tool: "#tool", gauge: "#gauge", certificate: "#gauge-certificate" };

export function offerRecord(job) {
  const form = find("#record-form");
  if (!form) return;
  find("#serial").addEventListener("input", (e) => {
    e.target.setCustomValidity(e.target.validity.patternMismatch ? e.target.title : "");
  });
  find("#date").value = new Date().toISOString().slice(0, 10);
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    const serial = find("#serial").value, temperature = find("#temperature").value;
    const circumstances = { date: find("#date").value, ...(temperature && { temperature_degC: Number(temperature) }) };
    for (const [name, field] of Object.entries(FIELDS)) circumstances[name] = find(field).value;
    try {
      await post(`/api/records/${encodeURIComponent(serial)}/entries`, { job, circumstances });
      location.href = `${root}/robots/${encodeURIComponent(serial)}`;
    } catch (problem) { say(find("#record-message"), problem.message, true); }
  });
}
