"""A page of strangers that tries all that a browser lets it do to a service."""

import contextlib
import json
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from string import Template
from typing import Any

# What the page was able to read ends in `window.loot`, what it tried in `window.tried`.
PAGE = Template(
    """<!doctype html><title>Win a camera</title><body><script>
const target = $target, posts = $posts, gets = $gets;
window.loot = []; window.tried = 0; window.done = false;
const frames = [];
const LONGEST_MS = 15000; // that anything is waited for which ends by itself
function frame(name) {
  const made = document.createElement("iframe");
  made.name = name;
  made.answered = new Promise((resolve) => {
    let loads = 0; // the first is of the empty frame
    made.onload = () => { loads += 1; if (loads === 2) resolve(); };
    setTimeout(resolve, LONGEST_MS);
  });
  document.body.append(made);
  frames.push(made);
  return made;
}
function post(path, type, fields) {
  const form = document.createElement("form");
  Object.assign(form, { method: "post", action: target + path, enctype: type });
  form.target = "frame" + frames.length;
  frame(form.target);
  for (const [name, value] of Object.entries(fields)) {
    const input = document.createElement("input");
    Object.assign(input, { type: "hidden", name, value });
    form.append(input);
  }
  document.body.append(form);
  form.submit();
  window.tried += 1;
}
async function take(path, given) {
  window.tried += 1;
  try {
    const answer = await fetch(target + path, { credentials: "include", ...given });
    const text = await answer.text();
    if (text) window.loot.push(["fetch", path, text.slice(0, 80)]);
  } catch {}
}
function load(kind, path) {
  window.tried += 1;
  return new Promise((resolve) => {
    const made = document.createElement(kind);
    made.onload = () => { window.loot.push([kind, path]); resolve(); };
    made.onerror = resolve;
    if (kind === "link") Object.assign(made, { rel: "stylesheet", href: target + path });
    else made.src = target + path;
    document.body.append(made);
    setTimeout(resolve, 3000);
  });
}
function follow(path) {
  window.tried += 1;
  return new Promise((resolve) => {
    const source = new EventSource(target + path, { withCredentials: true });
    source.onopen = () => window.loot.push(["events", path]);
    source.onerror = () => { source.close(); resolve(); };
    setTimeout(() => { source.close(); resolve(); }, 3000);
  });
}
const answeredBeacons = () =>
  performance.getEntriesByType("resource").filter((entry) => entry.initiatorType === "beacon");
async function beaconsAnswered() {
  const end = performance.now() + LONGEST_MS;
  while (answeredBeacons().length < posts.length && performance.now() < end)
    await new Promise((resolve) => setTimeout(resolve, 20));
}
(async () => {
  for (const [path, fields] of posts) {
    for (const type of ["text/plain", "multipart/form-data", "application/x-www-form-urlencoded"])
      post(path, type, fields);
    const plain = { method: "POST", body: JSON.stringify(fields) };
    await take(path, { ...plain, mode: "no-cors", headers: { "Content-Type": "text/plain" } });
    await take(path, { ...plain, mode: "cors", headers: { "Content-Type": "application/json" } });
    navigator.sendBeacon(target + path, JSON.stringify(fields));
  }
  for (const path of gets) {
    await take(path, { mode: "cors" });
    await take(path, { mode: "no-cors" });
  }
  await Promise.all([load("img", $image), load("script", "/cameras"), load("link", "/"),
    follow("/events?after=0")]);
  await Promise.all([beaconsAnswered(), ...frames.map((made) => made.answered)]);
  for (const made of frames) {
    try {
      const text = made.contentDocument?.body?.textContent;
      if (text) window.loot.push(["frame", text.slice(0, 80)]);
    } catch {}
  }
  window.done = true;
})();
</script>"""
)


@contextlib.contextmanager
def hostile_page(
    target: str, *, posts: list[tuple[str, dict[str, str]]], gets: list[str], image: str
) -> Iterator[int]:
    """The port of a server with such a page, as long as the block lasts."""
    html = PAGE.substitute(
        target=json.dumps(target),
        posts=json.dumps(posts),
        gets=json.dumps(gets),
        image=json.dumps(image),
    ).encode()

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self.send_response(200)
            self.send_header("Content-Type", "text/html")
            self.end_headers()
            self.wfile.write(html)

        def log_message(self, format: str, *args: Any) -> None:
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    try:
        yield server.server_address[1]
    finally:
        server.shutdown()
        server.server_close()
