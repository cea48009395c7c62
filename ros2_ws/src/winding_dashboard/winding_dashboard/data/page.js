// Shows the newest snapshot of the server, and nothing else; sends what an operator asks for.
"use strict";

const PERIOD = 200; // ms from one question for a snapshot to the next
const PATIENCE = 3000; // ms that the server has for an answer
const OLD = 1000; // ms after which what is shown is marked as old
const AGAIN = 500; // ms until an emergency stop without an answer is sent again

const byId = (id) => document.getElementById(id);
const drawn = {};
const sight = { yaw: -14, pitch: 18 };
let shown = { server: "", sequence: -1, ask: {}, age: 0 };
let asked = performance.now(); // when the shown snapshot was asked for: it is younger than this
let late = false;
let lost = false;
let others = new AbortController(); // ends every request but those for an emergency stop
// A form follows the server until something is typed in it, and again once that is taken or discarded.
const forms = { form: { server: "", edited: new Set() }, limits: { server: "", edited: new Set() } };

const within = (time) => AbortSignal.any([others.signal, AbortSignal.timeout(time)]);

// ---- what is shown

function apply(snapshot) {
  shown = snapshot;
  for (const [id, html] of Object.entries(snapshot.parts)) {
    if (drawn[id] === html) continue;
    drawn[id] = html;
    byId(id).innerHTML = html;
  }
  for (const [id, text] of Object.entries(snapshot.texts)) {
    if (byId(id).textContent !== text) byId(id).textContent = text;
  }
  for (const [id, flag] of Object.entries(snapshot.hidden)) byId(id).hidden = flag;
  for (const [id, flag] of Object.entries(snapshot.pressed)) byId(id).setAttribute("aria-pressed", flag);
  for (const [id, flag] of Object.entries(snapshot.bad)) byId(id).classList.toggle("bad", flag);
  for (const [id, reason] of Object.entries(snapshot.off)) {
    byId(id).disabled = reason !== "";
    byId(id).title = reason;
  }
  const picture = snapshot.picture ? `data:image/jpeg;base64,${snapshot.picture}` : "";
  if (drawn.picture !== picture) {
    drawn.picture = picture;
    byId("picture").hidden = !picture;
    if (picture) byId("picture").src = picture;
  }
  byId("answer").classList.toggle("alarm", snapshot.alarm);
  for (const dialog of document.querySelectorAll("dialog[open]")) {
    const of = actionOf(dialog);
    if (snapshot.ask[of] !== dialog.id || snapshot.off[of]) dialog.close();
  }
  fill(snapshot);
  showPlace(snapshot.playback);
  tellAge();
}

function showPlace(playback) {
  if (!playback) return;
  const slider = byId("position");
  byId("paused").textContent = playback.paused ? "Go on" : "Pause";
  slider.max = playback.length;
  // What is being dragged stays under the finger.
  if (!slider.matches(":active")) slider.value = playback.position;
  tellPlace();
}

function tellPlace() {
  const { value, max } = byId("position");
  byId("place").textContent = `${Number(value).toFixed(1)} of ${Number(max).toFixed(1)} s`;
}

function fill(snapshot) {
  if (snapshot.form.fields) {
    follow("form", entries(snapshot.form));
    showOwn();
  }
  follow("limits", snapshot.limits);
  const { server, known, edited } = forms.form;
  byId("discard").hidden = !edited.size;
  byId("elsewhere").hidden = !edited.size || server === known;
}

function entries({ fields, ...choices }) {
  const empty = Object.fromEntries([...document.querySelectorAll("[data-field]")].map((field) => [field.name, ""]));
  return { ...empty, ...fields, ...choices };
}

// The first values of the server fill what is not typed yet; later ones leave an edited form alone, whole,
// so that it never holds a mixture of two operators' conditions.
function follow(id, values) {
  const form = forms[id];
  const first = form.known === undefined;
  form.server = JSON.stringify(values);
  if (form.server === form.known || (form.edited.size && !first)) return;
  form.known = form.server;
  put(id, Object.fromEntries(Object.entries(values).filter(([name]) => !form.edited.has(name))));
}

function put(id, values) {
  for (const [name, value] of Object.entries(values)) {
    const element = byId(id).elements[name];
    if (element.type === "checkbox") element.checked = value;
    else element.value = value;
  }
}

function release(id) {
  forms[id].edited.clear();
  forms[id].known = "";
}

const showOwn = () => { byId("own").hidden = byId("form").elements.case.value !== "0"; };

function tellAge() {
  const age = (performance.now() - asked) / 1000 + (shown.age ?? 0);
  const old = shown.sequence >= 0 && 1000 * age > OLD;
  document.body.classList.toggle("old", old);
  byId("age").hidden = !old;
  const why = lost ? "the page's server does not answer" : "no data from the machine";
  const text = old ? `What stands here is ${age.toFixed(0)} s old: ${why}` : "";
  if (byId("age").textContent !== text) byId("age").textContent = text;
}

// ---- one question at a time: a slow browser skips what came meanwhile

async function look() {
  const began = performance.now();
  const query = new URLSearchParams({ marker: byId("marker").value, yaw: sight.yaw, pitch: sight.pitch });
  try {
    const answer = await fetch(`snapshot?${query}`, { cache: "no-store", signal: within(PATIENCE) });
    if (!answer.ok) throw new Error(answer.statusText);
    const snapshot = await answer.json();
    lost = false;
    const slow = performance.now() - began > OLD;
    const newer = snapshot.server !== shown.server || snapshot.sequence > shown.sequence;
    // An answer that was on its way while the browser slept is of the past: ask once more.
    if (slow && !late) {
      late = true;
      return look();
    }
    late = slow;
    if (newer || snapshot.sequence === shown.sequence) {
      asked = began;
      if (newer || drawn.query !== query.toString()) apply(snapshot);
      drawn.query = query.toString();
    }
  } catch (error) {
    lost = true;
  }
  tellAge();
  setTimeout(look, Math.max(0, PERIOD - (performance.now() - began)));
}

// ---- what is asked for

async function post(path, more = {}, signal = within(150000)) {
  const body = JSON.stringify({ server: shown.server, sequence: shown.sequence, ...more });
  const answer = await fetch(path, { method: "POST", body, headers: { "Content-Type": "application/json" }, signal });
  if (!answer.ok) throw new Error(await answer.text());
  return answer.json();
}

function unanswered(what, error) {
  if (error.name === "AbortError") return;
  byId("answer").textContent = `${what}: not answered (${error.message}); use the machine's own controls`;
  byId("answer").classList.add("alarm");
}

// A browser has few connections to a server: whatever else waits for an answer gives its own away.
async function stopNow() {
  others.abort();
  others = new AbortController();
  let answered = false;
  const stop = () => post("command/emergency_stop", {}, AbortSignal.timeout(2 * PATIENCE)).then(
    () => { answered = true; },
    (error) => { if (!answered) unanswered("emergency stop", error); },
  );
  for (let passed = 0; passed < PATIENCE && !answered; passed += AGAIN) {
    stop();
    await new Promise((wake) => setTimeout(wake, AGAIN));
  }
  if (!answered) unanswered("emergency stop", new Error("no answer yet"));
}

// A browser keeps what is no number to itself.
const entered = (field) => {
  if (field.type !== "number") return field.value;
  if (field.validity.badInput) return "what is no number";
  return field.value === "" ? "" : Number(field.value);
};

function typed() {
  const elements = byId("form").elements;
  const fields = {};
  for (const field of document.querySelectorAll("[data-field]")) {
    if (entered(field) !== "") fields[field.name] = entered(field);
  }
  return { case: Number(elements.case.value), law: elements.law.value, take_up: elements.take_up.checked, fields };
}

async function act(button) {
  if (button.id === "emergency_stop") return stopNow();
  let more = {};
  if (button.id === "prepare") more = { form: typed() };
  if (button.id === "record") more = { on: byId("recording").hidden };
  try {
    const { refused } = await post(button.dataset.post, more);
    if (button.id === "prepare" && !refused) release("form");
  } catch (error) {
    unanswered(button.textContent.toLowerCase(), error);
  }
}

// A question is no modal dialog: what stops the machine stays within reach of mouse and keyboard.
const actionOf = (dialog) => dialog.querySelector("[data-act]").dataset.act;

async function ask(button, dialog) {
  if (button.id === "prepare") {
    const { refused } = await post("prepare", { form: { ...typed(), check: true } });
    if (refused) return;
  }
  for (const open of document.querySelectorAll("dialog[open]")) open.close();
  dialog.show();
}

for (const button of document.querySelectorAll("[data-post]")) {
  button.addEventListener("click", () => {
    const dialog = shown.ask[button.id];
    if (!dialog) act(button);
    else ask(button, byId(dialog)).catch((error) => unanswered(button.textContent.toLowerCase(), error));
  });
}
document.addEventListener("keydown", (event) => {
  if (event.altKey && event.code === "KeyE" && !byId("emergency_stop").disabled) stopNow();
});
for (const dialog of document.querySelectorAll("dialog")) {
  const button = byId(actionOf(dialog));
  const leave = () => {
    dialog.close();
    button.focus();
  };
  dialog.querySelector("[data-keep]").addEventListener("click", leave);
  dialog.addEventListener("keydown", (event) => { if (event.key === "Escape") leave(); });
  dialog.querySelector("[data-act]").addEventListener("click", () => {
    leave();
    act(button);
  });
}
byId("limits").addEventListener("submit", async (event) => {
  event.preventDefault();
  const values = {};
  for (const field of byId("limits").elements)
    if (field.name && !field.closest("[hidden]")) values[field.name] = entered(field);
  try {
    await post("limits", { limits: values });
    // Refused or not, the fields show what holds.
    release("limits");
  } catch (error) {
    unanswered("limits", error);
  }
});
for (const id of ["save", "load"]) {
  byId(id).addEventListener("click", async () => {
    try {
      const { form } = await post(`recipe/${id}`, { name: byId("recipe").value, form: typed() });
      if (!form?.fields) return;
      // As if it had been typed, to be prepared or discarded.
      put("form", entries(form));
      for (const name of Object.keys(entries(form))) forms.form.edited.add(name);
      showOwn();
    } catch (error) {
      unanswered("recipe", error);
    }
  });
}
const play = (asked) => post("playback", asked).catch((error) => unanswered("playback", error));
byId("paused").addEventListener("click", () => play({ paused: !shown.playback.paused }));
byId("position").addEventListener("change", (event) => play({ position: Number(event.target.value) }));
byId("position").addEventListener("input", tellPlace);
for (const id of Object.keys(forms))
  byId(id).addEventListener("input", (event) => forms[id].edited.add(event.target.name));
byId("discard").addEventListener("click", () => release("form"));
byId("form").elements.case.addEventListener("change", showOwn);
byId("form").addEventListener("submit", (event) => event.preventDefault());

// ---- looking at the cylinder from elsewhere

const scene = byId("cylinder");
scene.addEventListener("pointerdown", (event) => scene.setPointerCapture(event.pointerId));
scene.addEventListener("pointermove", (event) => {
  if (!scene.hasPointerCapture(event.pointerId)) return;
  sight.yaw = Math.round(Math.max(-80, Math.min(80, sight.yaw - 0.4 * event.movementX)));
  sight.pitch = Math.round(Math.max(-80, Math.min(80, sight.pitch + 0.4 * event.movementY)));
});

setInterval(tellAge, 250);
document.addEventListener("visibilitychange", tellAge);
look();
