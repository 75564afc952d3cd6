// Keeps the checklist of a session on the device, with what it is drawn by: at the cell there may be no network.
const CACHE = "edbb-session";
const ROOT = self.location.pathname.replace(/\/worker\.js$/, ""); // where the service lies on its host
const KEPT = [/^\/sessions\/[0-9a-f]{24}$/, /^\/static\//];

self.addEventListener("install", () => self.skipWaiting());
self.addEventListener("activate", (event) => event.waitUntil(self.clients.claim()));
self.addEventListener("fetch", (event) => {
  const url = new URL(event.request.url);
  const wanted = event.request.method === "GET" && url.origin === location.origin && KEPT.some((p) => p.test(url.pathname.slice(ROOT.length)));
  if (wanted) event.respondWith(newestOf(event.request));
});

// The newest there is: of the service, and where it does not answer what was kept.
async function newestOf(request) {
  const cache = await caches.open(CACHE);
  try {
    const fresh = await fetch(request);
    if (fresh.status >= 502 && fresh.status <= 504) throw new Error("gone"); // so says a proxy before a service that is gone
    if (fresh.type === "opaqueredirect") await caches.delete(CACHE); // whoever has to log in first sees nothing kept
    else if (fresh.ok) await cache.put(request.url, fresh.clone());
    return fresh;
  } catch (gone) {
    const kept = await cache.match(request.url);
    if (kept) return kept;
    throw gone;
  }
}
