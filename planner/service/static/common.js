// What all pages share: requests, uploads, and following jobs.
import { make } from "./view/make.js";

export { make };

export const find = (selector) => document.querySelector(selector);

/** Where the service lies on its host: empty, or a path such as /edbb. */
export const root = document.documentElement.dataset.root ?? "";

let gone = null; // while the service does not answer: what says so, and who waits for it

/** Say that the service does not answer, until it does again. */
function tellGone() {
  if (gone) return;
  const text = "The service does not answer. Nothing that was asked for is lost; this page goes on by itself when it is back.";
  gone = { note: make("p", { className: "gone", role: "alert" }, text), waiting: [] };
  document.body.prepend(gone.note);
  setTimeout(lookAgain, 1000);
}

async function lookAgain() {
  const answer = await fetch(`${root}/api/health`, { cache: "no-store" }).catch(() => null);
  if (answer?.status === 401) { logIn(); return; }
  if (!answer?.ok) { setTimeout(lookAgain, 3000); return; }
  const { note, waiting } = gone;
  gone = null;
  note.remove();
  waiting.forEach((go) => go());
}

/** Resolves when the service answers; at once where it is not known to be gone. */
export const serviceBack = () => gone ? new Promise((go) => gone.waiting.push(go)) : Promise.resolve();

const logIn = () => location.assign(`${root}/login?next=${encodeURIComponent(location.pathname.slice(root.length))}`);

/** Ask the service; that it does not answer is said in plain words. */
export async function reach(path, options) {
  const answer = await fetch(root + path, options).catch(() => null);
  if (answer && answer.status !== 502 && answer.status !== 504) return answer; // so says a proxy before a service that is gone
  tellGone();
  throw new Error("The service does not answer. Try again when it is back.");
}

async function answerOf(response) {
  if (response.status === 401) logIn();
  const json = (response.headers.get("content-type") || "").includes("json");
  const content = json ? await response.json() : await response.text();
  if (!response.ok) throw new Error(content.detail || response.statusText);
  return content;
}

export const get = async (path) => answerOf(await reach(path));

/** A page of a list, and the address of the next one, of its Link header; none behind the last. */
export async function page(path) {
  const answer = await reach(path);
  const next = (answer.headers.get("link") || "").match(/<([^>]+)>; rel="next"/);
  return { content: await answerOf(answer), next: next ? next[1].slice(root.length) : null };
}

export const send = async (method, path, body) => answerOf(await reach(path, {
  method, headers: { "content-type": "application/json" }, body: body === undefined ? undefined : JSON.stringify(body),
}));

export const post = (path, body) => send("POST", path, body ?? {});

// the name as the service takes it: letters of the ASCII, no folder
export const plainName = (name) => name.replace(/[^A-Za-z0-9._+-]/g, "_").replace(/^[^A-Za-z0-9_]+/, "").slice(-100) || "file";

export function upload(kind, file, onShare = () => {}) {
  return new Promise((resolve, reject) => {
    const request = new XMLHttpRequest();
    const name = plainName(file.name);
    request.open("POST", `${root}/api/${kind}?name=${encodeURIComponent(name)}`);
    request.setRequestHeader("content-type", "application/octet-stream");
    request.upload.onprogress = (e) => e.lengthComputable && onShare(e.loaded / e.total);
    request.onerror = () => { tellGone(); reject(new Error(`${file.name}: the service does not answer; send it again when it is back`)); };
    request.onload = () => {
      let content = {};
      try { content = JSON.parse(request.responseText); } catch { /* no JSON came */ }
      if (request.status === 201) resolve({ id: content.id, name });
      else reject(new Error(content.detail || `${file.name}: not taken (${request.status})`));
    };
    request.send(file);
  });
}

// One stream a page; the browser resumes it by the number of the last event.
export function follow(job, onEvent, after = 0) {
  const stream = new EventSource(`${root}/api/events?job=${job}&after=${after}`);
  let last = after;
  stream.onerror = () => {
    tellGone();
    if (stream.readyState === EventSource.CLOSED) serviceBack().then(() => follow(job, onEvent, last)); // an answer that was no stream
  };
  for (const kind of ["queued", "running", "progress", "end"]) {
    stream.addEventListener(kind, (e) => {
      last = Number(e.lastEventId);
      if (kind === "end") stream.close();
      onEvent(kind, JSON.parse(e.data));
    });
  }
  return stream;
}

// Resolves with the ended job; rejects with its problem.
export function finished(job, onEvent = () => {}) {
  return new Promise((resolve, reject) => follow(job, async (kind, data) => {
    onEvent(kind, data);
    if (kind !== "end") return;
    const found = await get(`/api/jobs/${job}`);
    if (found.state === "done") resolve(found);
    else reject(new Error(found.problem ? found.problem.detail : `the job was ${found.state}`));
  }));
}

export const say = (node, text, problem = false) => {
  node.textContent = text;
  node.classList.toggle("problem", problem);
};

export function showFacts(list, facts) {
  list.replaceChildren(...facts.flatMap(([what, value]) => [make("dt", {}, what), make("dd", {}, value)]));
}

// What only serves a page; a person looks for the others.
const HELPERS = ["plan-view", "fixture-view", "cell-check", "run-check", "simulation", "export"];
export const isResult = (job) => !HELPERS.includes(job.kind);

/** How far a job is, or what it has found. */
export const stateMark = (job) => make("span", { className: `state words ${job.sense ?? job.state}` }, job.verdict || job.state);

/** A time in the zone of whoever looks. */
export const timeText = (iso) => new Date(iso).toLocaleString("en-GB", {
  year: "numeric", month: "short", day: "2-digit", hour: "2-digit", minute: "2-digit", timeZoneName: "short" });

/** A day where whoever looks is, as year-month-day. */
export const dayText = (time) => [time.getFullYear(), time.getMonth() + 1, time.getDate()].map((n) => String(n).padStart(2, "0")).join("-");

export const sizeText = (bytes) => bytes > 1e6 ? `${(bytes / 1e6).toFixed(1)} MB` : `${Math.max(1, Math.round(bytes / 1e3))} kB`;

/** Tell whether a robot of this serial number is in the records and not withdrawn: asked of the list, as what is not there is an error. */
export async function isKnown(serial) {
  return (await get(`/api/records?most=1000&q=${encodeURIComponent(serial)}`)).some((robot) => robot.serial === serial && robot.state !== "withdrawn");
}

/** What was typed into the fields of a form that stand for options of a command, by their names. */
export function givenOptions(form) {
  const given = {};
  for (const field of form.querySelectorAll("[data-option]")) {
    if (field.type === "checkbox" ? !field.checked : field.value === "") continue;
    given[field.dataset.option] = { checkbox: true, number: Number(field.value) }[field.type] ?? field.value;
  }
  return given;
}

/** The cell of a robot that a tracker sees. */
export const tracked = (robot) => new File([`schema = "edbb-cell/1"\nrobot = "${robot}"\n[gauge]\nkind = "tracker"\n`], "cell.toml");

/** What a person has brought: a cell with its files, or a robot alone, which a tracker sees. */
export async function ownCell(files) {
  const texts = await Promise.all(files.map(async (f) => (f.name.endsWith(".toml") ? f.slice(0, 100000).text() : "")));
  const cell = files.find((_, k) => texts[k].includes("edbb-cell/1"));
  if (!cell && files.length > 1) throw new Error('none of the files has schema = "edbb-cell/1": name the cell, or one robot alone');
  const others = await Promise.all(files.filter((f) => f !== cell).map((f) => upload("files", f)));
  return { cell: (await upload("cells", cell ?? tracked(others[0].name))).id, files: others };
}
