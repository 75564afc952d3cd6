// Whoever logs in anew finds nothing on the device that somebody else had opened.
if ("caches" in window) caches.keys().then((names) => names.forEach((name) => caches.delete(name)));
