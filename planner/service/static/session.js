// The checklist at the cell: what is ticked is kept on this device at once, and sent when the service answers.
import { find, post, root, say, timeText } from "./common.js";

const { session, plan, serial } = document.body.dataset;
const key = `edbb-session-${session}`, who = find("#who"), boxes = [...document.querySelectorAll(".checklist input")];
const LOOK_MS = 10_000; // between two looks for what other devices have ticked
let ticks = read(), mayTick = true, sending = false;

/** What is known of each step: done, at, person; ``unsent`` where the service has not been told. */
function read() {
  try {
    return JSON.parse(localStorage.getItem(key) || "{}");
  } catch { return {}; }
}

const unsent = () => Object.entries(ticks).filter(([, t]) => t.unsent);

function keep() {
  try { localStorage.setItem(key, JSON.stringify(ticks)); } catch { /* a private window keeps nothing */ }
}

function show() {
  for (const box of boxes) {
    const tick = ticks[box.id];
    box.checked = tick?.done ?? false;
    box.closest("li").querySelector(".ticked").textContent = tick?.done ? `${timeText(tick.at)}${tick.person ? `, ${tick.person}` : ""}` : "";
  }
  const done = boxes.filter((b) => b.checked).length;
  find("#done").textContent = done === boxes.length ? "All steps are done." : `${done} of ${boxes.length} steps are done.`;
}

function tick(box, done) {
  ticks[box.id] = { done, at: new Date().toISOString(), person: document.body.dataset.named || who?.value || "", unsent: true };
}

/** Send what is unsent, and take over what others have ticked. */
async function sync() {
  if (sending) return;
  sending = true;
  const open = mayTick ? unsent() : [];
  const body = { person: who?.value ?? "", ticks: open.map(([step, { done, at }]) => ({ step, done, at })) };
  try {
    const path = `/api/sessions/${session}`;
    const answer = await fetch(root + path + (open.length ? "/ticks" : ""), open.length ? { method: "POST", headers: { "content-type": "application/json" }, body: JSON.stringify(body) } : {});
    if (answer.status === 403) { mayTick = false; tell("You may look, not tick for others: what you tick stays on this device."); return; }
    if (answer.status === 409) { end(); return; }
    if (answer.status === 401) { tell("Log in to send what is ticked: it is kept on this device."); return; }
    if (!answer.ok) throw new Error(answer.statusText);
    const before = new Map(open.map(([step, t]) => [step, t.at]));
    const found = await answer.json();
    if (found.ended) end();
    for (const { step, ...known } of found.ticks) {
      const own = ticks[step];
      if (!own?.unsent || own.at === before.get(step)) ticks[step] = known; // ticked again meanwhile: that is sent next
    }
    keep();
    show();
    tell(unsent().length ? "" : "All that is ticked is sent; other devices see it.");
  } catch { tell(`There is no connection to the service. ${unsent().length ? "What is ticked is kept on this device and sent when it is back." : "You can go on ticking."}`); }
  finally { sending = false; }
}

/** Somebody began the session again: what is ticked from now on would be lost. */
function end() {
  mayTick = false;
  find("#ended").hidden = false;
  find("#again")?.remove();
  for (const box of boxes) box.disabled = true;
  for (const [step] of unsent()) delete ticks[step];
  keep();
  show();
}

const tell = (text) => { find("#sent").textContent = text; };

for (const box of boxes) {
  box.closest("li").querySelector("label span").append(Object.assign(document.createElement("span"), { className: "ticked hint" }));
  box.addEventListener("change", () => { tick(box, box.checked); keep(); show(); sync(); });
  box.disabled = !find("#ended").hidden; // not before a tick is kept: one made earlier would be lost
}
if (who) {
  who.value ||= localStorage.getItem("edbb-name") ?? "";
  who.addEventListener("input", () => localStorage.setItem("edbb-name", who.value));
}
// asked first: the others of this session stand at the cell too
find("#again")?.addEventListener("click", async (event) => {
  if (event.target.dataset.sure !== "yes") {
    event.target.dataset.sure = "yes";
    event.target.textContent = "Begin a new session";
    say(find("#again-message"), "This session ends for everybody, and stays in the history of the robot with its ticks. Press again to begin a new one.");
    return;
  }
  try { location.href = root + (await post("/api/sessions", { plan, serial, anew: true })).url; } catch (problem) { say(find("#again-message"), problem.message, true); }
});
addEventListener("online", sync);
document.addEventListener("visibilitychange", () => { if (!document.hidden) sync(); });
setInterval(sync, LOOK_MS);
show();
sync();

// from now on the page opens without a network too; only over TLS or on this machine do browsers allow it
if ("serviceWorker" in navigator) {
  await navigator.serviceWorker.register(`${root}/worker.js`);
  await navigator.serviceWorker.ready;
  const drawn = performance.getEntriesByType("resource").map((r) => r.name).filter((url) => new URL(url).pathname.startsWith(`${root}/static/`));
  const claimed = navigator.serviceWorker.controller ? Promise.resolve() : new Promise((go) => navigator.serviceWorker.addEventListener("controllerchange", go, { once: true }));
  await claimed;
  await Promise.all([location.href, ...drawn].map((url) => fetch(url).catch(() => null)));
  find("#offline").textContent = "This page opens on this device without a network, too.";
}
