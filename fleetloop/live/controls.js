"use strict";
// Orders to the run, dialogs and keys. The server decides who may; here is only what it looks like.
const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4, 0];
let orders = 0;

function order(request, parameters) {
  orders += 1;
  models.orders.data = {json: [JSON.stringify({id: orders, request, ...parameters})]};
  say("");
}

function answered(answer) {
  if (answer.error) say(answer.error, true);
  else if (answer.said) say(answer.said);
}

let quiet = 0;
function say(text, wrong) {
  const message = at("message");
  message.textContent = text; message.hidden = !text; message.className = wrong ? "wrong" : "";
  clearTimeout(quiet);
  if (text) quiet = setTimeout(() => { message.hidden = true; }, wrong ? 12000 : 5000);
}

const yours = () => board !== null && board.controls.yours && !board.controls.outside && !board.ended;
const paused = () => board !== null && board.run.state === "paused";

function showControls() {
  const mine = yours(), {holder, you, outside} = board.controls;
  document.body.classList.toggle("read-only", !mine);
  for (const control of document.querySelectorAll("#controls button, #controls input, #controls select, .controls-only"))
    if (control.id !== "take") control.disabled = !mine;
  at("pause").textContent = paused() ? "Go on" : "Pause";
  at("step").disabled = at("ticks").disabled = !(mine && paused());
  at("speed_group").hidden = facts.realtime;
  at("holder").textContent = board.ended ? "The run has ended." : mine ? "You have the controls." : outside || holder ? `Read only: ${outside || holder} has the controls.` : "Read only.";
  at("holder").title = you;
  at("take").hidden = mine || board.ended;
  at("take").disabled = Boolean(outside);
  const speed = board.run.speed;
  if (finite(speed) && document.activeElement !== at("speed")) {
    if (![...at("speed").options].some((one) => Number(one.value) === speed)) at("speed").append(el("option", {value: speed}, `${speed} ×`));
    at("speed").value = String(speed);
  }
}

function nextSpeed(step) {
  const now = Number(at("speed").value), sorted = SPEEDS.map((one) => one || Infinity);
  const place = sorted.findIndex((one) => one >= (now || Infinity));
  const to = SPEEDS[Math.min(SPEEDS.length - 1, Math.max(0, place + step))];
  at("speed").value = String(to); order("run.speed", {factor: to});
}

// --- dialogs ---------------------------------------------------------------------------------------

function confirmed(title, text, yes, act) {
  at("confirm_title").textContent = title; at("confirm_text").textContent = text; at("confirm_yes").textContent = yes;
  const dialog = at("confirm_dialog");
  dialog.returnValue = "";
  dialog.onclose = () => { if (dialog.returnValue === "yes") act(); };
  dialog.showModal();
  at("confirm_yes").focus();
}

const kindOf = (name) => facts.kinds.find((one) => one.kind === name);
const title = (key) => {
  const units = {_N_m_s: "N·m·s", _N_m: "N·m", _m_s: "m/s", _rad_s: "rad/s", _kg_m2: "kg·m²", _rad: "rad", _kg: "kg", _m: "m", _s: "s", _N: "N", _V: "V", _A: "A", _Hz: "Hz"};
  const unit = Object.keys(units).find((one) => key.endsWith(one));
  return unit ? [key.slice(0, -unit.length).replaceAll("_", " "), units[unit]] : [key.replaceAll("_", " "), ""];
};

function buildForm() {
  const kind = kindOf(at("kind").value), box = at("parameters");
  at("kind_about").textContent = kind.about + (kind.needs.length ? ` Needs ${kind.needs.join(", ")}.` : "");
  at("for_s").closest("label").hidden = kind.instant;
  at("fault_wrong").textContent = "";
  box.replaceChildren(...kind.parameters.map((one) => {
    const [text, unit] = title(one.key);
    if (one.choices && one.many) {
      const boxes = one.choices.map((choice) => el("label", {class: "tick"}, el("input", {type: "checkbox", name: one.key, value: choice, "data-many": true}), choice));
      return el("fieldset", {class: "field"}, el("legend", {}, text), el("div", {class: "ticks"}, ...boxes), el("small", {class: "muted"}, one.required ? "choose" : "none: all"));
    }
    const input = one.choices
      ? el("select", {name: one.key}, ...one.choices.map((choice) => el("option", {value: choice, selected: choice === one.default}, choice)))
      : el("input", {name: one.key, type: one.number ? "number" : "text", step: one.whole ? "1" : "any", min: one.minimum, max: one.maximum, value: one.default ?? "", required: one.required, "data-number": one.number});
    return el("label", {class: "field", title: one.about}, text, el("span", {class: "with-unit"}, input, el("span", {class: "unit"}, unit)), el("small", {class: "muted"}, [one.about, one.values].filter(Boolean).join("; ")));
  }));
}

function faultOfForm() {
  const fault = {kind: at("kind").value}, many = {};
  for (const input of at("parameters").querySelectorAll("[name]")) {
    if (input.dataset.many !== undefined) { if (input.checked) (many[input.name] ||= []).push(input.value); }
    else if (input.value !== "") fault[input.name] = input.dataset.number !== undefined ? Number(input.value) : input.value;
  }
  Object.assign(fault, many);
  if (at("for_s").value !== "" && !kindOf(fault.kind).instant) fault.for_s = Number(at("for_s").value);
  if (at("fault_name").value.trim()) fault.name = at("fault_name").value.trim();
  return fault;
}

// --- wiring ----------------------------------------------------------------------------------------

const act = {
  pause: () => order(paused() ? "run.resume" : "run.pause"),
  step: () => { if (paused() && at("ticks").reportValidity()) order("run.step", {ticks: Number(at("ticks").value)}); },
  faster: () => nextSpeed(1),
  slower: () => nextSpeed(-1),
  clear: () => { if (!at("clear").hidden) order("fault.clear", {names: []}); },
  inject: () => { at("fault_wrong").textContent = ""; at("fault_dialog").showModal(); },
  estop: () => confirmed("E-stop", "All drives of all robots drop their torque and latch.", "E-stop", () => order("estop")),
  stop: () => confirmed("Stop the run", "The run ends now. Its record is kept; what was not reached is not checked.", "Stop run", () => order("run.stop")),
  take: () => (board.controls.holder ? confirmed("Take the controls", `${board.controls.holder} has them now and will be read only.`, "Take controls", () => order("controls.take")) : order("controls.take")),
};
const KEYS = {" ": "pause", ".": "step", "+": "faster", "=": "faster", "-": "slower", e: "estop", f: "inject", c: "clear"};

function wire() {
  for (const [id, run] of Object.entries(act)) at(id).addEventListener("click", run);
  at("speed").append(...SPEEDS.map((one) => el("option", {value: one, selected: one === 0}, one ? `${one} ×` : "as fast as it can")));
  at("speed").addEventListener("change", () => order("run.speed", {factor: Number(at("speed").value)}));
  at("leader").addEventListener("submit", (event) => { event.preventDefault(); order("run.leader_speed", {speed_m_s: Number(at("v_r").value), ramp_s: Number(at("ramp").value)}); });
  at("kind").append(...facts.kinds.map((one) => el("option", {value: one.kind}, one.kind.replaceAll("_", " "))));
  at("kind").addEventListener("change", buildForm);
  at("fault_form").addEventListener("submit", (event) => { event.preventDefault(); order("fault.inject", {fault: faultOfForm()}); at("fault_dialog").close(); });
  at("fault_form").querySelector(".cancel").addEventListener("click", () => at("fault_dialog").close());
  at("theme").addEventListener("click", toggleTheme);
  at("help").addEventListener("click", () => at("help_dialog").showModal());
  addEventListener("keydown", pressed);
  buildForm();
}

function pressed(event) {
  const typing = /^(input|select|textarea)$/i.test(event.target.tagName), open = document.querySelector("dialog[open]");
  if (typing || open || event.ctrlKey || event.altKey || event.metaKey) return;
  if (event.key === "?") { event.preventDefault(); at("help_dialog").showModal(); return; }
  if (event.key === "t") { toggleTheme(); return; }
  const name = KEYS[event.key];
  if (!name || !yours()) return;
  event.preventDefault();
  act[name]();
}

function toggleTheme() {
  const root = document.documentElement;
  const dark = root.dataset.theme ? root.dataset.theme === "dark" : matchMedia("(prefers-color-scheme: dark)").matches;
  root.dataset.theme = dark ? "light" : "dark";
  repaint();
}

// A plot paints half of its outermost pixels over: only another size clears all of it.
function repaint() {
  document.body.classList.add("repainting");
  setTimeout(() => { document.body.classList.remove("repainting"); redraw(); }, 80);
}

// Plots take their colours from the page's variables whenever they paint.
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", repaint);

function begin() {
  at("scenario").textContent = facts.scenario; at("run").textContent = facts.run;
  at("of").textContent = `of ${facts.ends_at_s} s`;
  document.body.classList.add("read-only");
  showEdgeLegend(); wire();
  let waited = 0;
  const timer = setInterval(() => {
    const doc = Bokeh.documents[0];
    waited += 1;
    if (doc && doc.get_model_by_name("feed") && models.feed === undefined) { clearInterval(timer); connect(doc); doc.on_event("connection_lost", lost); }
    else if (waited > 200) { clearInterval(timer); lost(); }
  }, 50);
}

function lost() {
  const ended = board !== null && board.ended;
  at("state").textContent = ended ? "ended" : "no connection"; at("state").className = `pill ${ended ? "ended" : "failed"}`;
  if (!ended) say("The connection to the run is lost. What is drawn stays; load the page again to go on.", true);
  if (board) { board.ended = true; showControls(); }
  at("holder").textContent = ended ? "The run has ended." : "No connection.";
}
begin();
