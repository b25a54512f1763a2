// Keeps the page for a phone without a network; `foxhunt page --installable` writes this beside it.
const PAGE = new URL(/* page */, location.href).href, OURS = `foxhunt ${PAGE} `, KEPT = `${OURS}/* hash */`;
// A server shows index.html at the address of its folder, too.
const ADDRESSES = PAGE.endsWith("/index.html") ? [PAGE, PAGE.slice(0, -"index.html".length)] : [PAGE];

addEventListener("install", (event) => event.waitUntil(caches.open(KEPT).then((kept) => kept.add(PAGE)).then(() => skipWaiting())));

async function forgetOlder() {
  for (const name of await caches.keys()) if (name.startsWith(OURS) && name !== KEPT) await caches.delete(name);
  await clients.claim();
}
addEventListener("activate", (event) => event.waitUntil(forgetOlder()));

addEventListener("fetch", (event) => {
  if (!ADDRESSES.includes(event.request.url.split(/[?#]/)[0])) return;
  event.respondWith(caches.match(PAGE).then((page) => page ?? fetch(event.request)));
});
