// Issues a certificate, and leads to it.
import { find, givenOptions, post, root, say } from "./common.js";

find("#issue-form")?.addEventListener("submit", async (event) => {
  event.preventDefault();
  try {
    const made = await post("/api/certificates", { job: document.body.dataset.job, ...givenOptions(event.target) });
    location.href = `${root}/certificates/${made.certificate.number}`;
  } catch (problem) { say(find("#issue-message"), problem.message, true); }
});
