import { find } from "/static/common.js";

const key = `edbb-session-${document.body.dataset.planId}`;
const boxes = [...document.querySelectorAll(".checklist input")];
let ticked = new Set();
try { ticked = new Set(JSON.parse(localStorage.getItem(key) || "[]")); } catch { /* kept nothing */ }

function tell() {
  const done = boxes.filter((b) => b.checked).length;
  find("#done").textContent = done === boxes.length ? "All steps are done." : `${done} of ${boxes.length} steps are done.`;
}

for (const box of boxes) {
  box.checked = ticked.has(box.id);
  box.addEventListener("change", () => {
    localStorage.setItem(key, JSON.stringify(boxes.filter((b) => b.checked).map((b) => b.id)));
    tell();
  });
}
find("#again").addEventListener("click", () => {
  boxes.forEach((b) => { b.checked = false; });
  localStorage.removeItem(key);
  tell();
});
tell();
