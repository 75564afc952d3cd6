// Remembers what a person fills in, and adds up the budget of the uncertainty.
import { find } from "./common.js";

const key = `edbb-certificate-${document.body.dataset.job}`;
const inputs = [...document.querySelectorAll(".sheet input")];
let kept = {};
try { kept = JSON.parse(localStorage.getItem(key) || "{}"); } catch { /* kept nothing */ }

function add() {
  const known = [...document.querySelectorAll("[data-u]")].map((n) => Number(n.dataset.u));
  const given = inputs.filter((i) => i.type === "number");
  const parts = [...known, ...given.filter((i) => i.value !== "").map((i) => Number(i.value))];
  find("#expanded").textContent = `${(2 * Math.hypot(...parts)).toFixed(3)} mm`;
  const open = given.filter((i) => i.value === "").map((i) => find(`label[for=${i.id}]`).textContent.toLowerCase());
  find("#open").textContent = open.length ? `Not contained, as nobody has stated it: ${open.join(", ")}.` : "";
}

for (const input of inputs) {
  input.value = kept[input.id] || input.defaultValue;
  input.addEventListener("input", () => {
    kept[input.id] = input.value;
    localStorage.setItem(key, JSON.stringify(kept));
    add();
  });
}
find("#print").addEventListener("click", () => window.print());
add();
