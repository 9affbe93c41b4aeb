"use strict";
// Tables and lists from the board; whatever a user named becomes a text node, never markup.
let board = null, known_events = 0, asked = false;
const at = (id) => document.getElementById(id);

function el(tag, options, ...children) {
  const made = document.createElement(tag);
  for (const [key, value] of Object.entries(options || {})) {
    if (key === "class") made.className = value;
    else if (key === "on") for (const [event, act] of Object.entries(value)) made.addEventListener(event, act);
    else if (value !== undefined && value !== false) made.setAttribute(key, value === true ? "" : value);
  }
  made.append(...children.filter((child) => child !== null && child !== undefined).map((child) => (child instanceof Node ? child : String(child))));
  return made;
}

// A list keeps its nodes while their content is the same, so that it can be selected and read.
function fill(parent, rows) {
  const text = JSON.stringify(rows.map((row) => row.key));
  if (parent.dataset.key === text) return;
  parent.dataset.key = text;
  parent.replaceChildren(...rows.map((row) => row.make()));
}

const number = (value, digits) => (finite(value) ? Number(value).toFixed(digits) : "–");
const brief = (value) => (!finite(value) ? "–" : value !== 0 && Math.abs(value) < 1e-3 ? Number(value).toExponential(0) : Number(value).toPrecision(2));
const chip = (r) => { const made = el("span", {class: "chip", "aria-hidden": "true"}); made.style.background = facts.styles[r].colour; return made; };

function showClock(t_s) {
  at("time").textContent = `${t_s.toFixed(facts.period_s < 0.01 ? 3 : 2)} s`;
  at("progress").value = Math.min(1, t_s / facts.ends_at_s);
}

function takeBoard() {
  const text = field(models.board.data, "json")[0];
  if (!text) return;
  board = JSON.parse(text);
  showState(); showExpectations(); showRobots(); showFaults(); showProcesses(); showEvents(); showControls();
  for (const answer of board.answers) answered(answer);
  if (!asked && !board.controls.holder && !board.ended) { asked = true; order("controls.take"); }
}

const WORDS = {starting: "starting", running: "running", paused: "paused", ending: "ending", held: "held", failed: "failed"};
function showState() {
  const run = board.run, state = board.ended ? "ended" : run.state || "running", pill = at("state");
  pill.textContent = WORDS[state] || state; pill.className = `pill ${state}`;
  const verdict = at("verdict");
  verdict.hidden = !board.verdict;
  if (board.verdict) { verdict.textContent = `${{held: "✓", failed: "✕"}[board.verdict] || "○"} ${board.verdict}`; verdict.className = `pill verdict ${board.verdict.replace(" ", "-")}`; }
  at("seen").textContent = board.seen_from_s > 0 ? `seen from ${number(board.seen_from_s, 2)} s on` : "";
  at("factor").textContent = finite(run.real_time_factor) ? `${run.real_time_factor < 0.995 ? brief(run.real_time_factor) : number(run.real_time_factor, 1)} × real time` : "–";
  at("leader_speed").textContent = finite(run.leader_speed_m_s) ? `${number(run.leader_speed_m_s, 2)} m/s` : "–";
  document.title = `${state === "running" ? "" : `${state} · `}${facts.scenario} · fleetloop live`;
}

function showExpectations() {
  const rows = board.expectations.map((one) => {
    const state = one.held === true ? "held" : one.held === false ? "failed" : "open";
    const margin = finite(one.margin) ? `margin ${brief(one.margin)} ${one.unit || ""}` : `${number(one.window.from_s, 1)}–${number(one.window.to_s, 1)} s`;
    return {key: [one.claim, state, margin], make: () => el("li", {class: state}, el("span", {class: "mark", "aria-label": state}, {held: "✓", failed: "✕", open: "○"}[state]), el("span", {}, one.name || one.claim), el("span", {class: "muted num"}, margin))};
  });
  fill(at("expectations"), rows.length ? rows : [{key: "none", make: () => el("li", {class: "muted"}, "The scenario expects nothing.")}]);
}

// A drive's state in small letters, "control" understood; its errors as the drive's manual has them.
const inWords = (drive) => drive.replace(/^[^:]*/, (state) => state.toLowerCase().replaceAll("_", " ").replace(/ control$/, "")).replaceAll("_", "_\u200b"); // long names break there
const share = (value) => (finite(value) ? `${(100 * value).toFixed(0)} %` : "–");
function showRobots() {
  const table = at("robots"), now = view.last && view.last.now;
  if (!table.tHead) table.append(el("thead", {}, el("tr", {}, ...[["robot"], ["phase", "of the controller; states of the drives"], ["error", "distance from the reference"], ["torque", "the larger wheel's; of its limit, if there is one"], ["bus", "load, or frames per second of an ideal bus"], ["age", "of the oldest neighbour's path variable"]].map(([text, title], n) => el("th", {class: n > 1 ? "num" : "", title}, text)))), el("tbody"));
  const rows = legend.robots.map((name, r) => {
    const said = (board.run.robots || {})[name] || {}, limit = facts.torque_limits[name];
    const pick = (column) => (now ? now[r * N + NOW[column]] : NaN);
    const error = Math.hypot(pick("x_e"), pick("y_e")), torque = Math.max(Math.abs(pick("tau_right")), Math.abs(pick("tau_left")));
    const drives = [...new Set([said.right_drive, said.left_drive].filter(Boolean).map(inWords))].join(" | ");
    const cells = [error < 0.1 ? `${number(1000 * error, 1)} mm` : `${number(error, 2)} m`, limit ? share(torque / limit) : `${number(torque, 2)} N·m`,
      finite(said.bus_load) ? share(said.bus_load) : finite(said.bus_frames_per_s) ? `${number(said.bus_frames_per_s / 1000, 1)} k/s` : "–", finite(said.neighbour_age_s) ? `${number(1000 * said.neighbour_age_s, 0)} ms` : "–"];
    const alarm = /stopped|diverged|absent/.test(said.phase || "");
    return {key: [name, said.phase, drives, cells], make: () => el("tr", {class: alarm ? "failed" : ""}, el("th", {scope: "row"}, chip(r), name),
      el("td", {class: "phase"}, said.phase || "–", drives ? el("small", {class: "muted"}, drives) : null), ...cells.map((text) => el("td", {class: "num"}, text)))};
  });
  fill(table.tBodies[0], rows);
  fill(at("robot_legend"), legend.charted.map((name, r) => ({key: [name, hidden.has(r)], make: () => el("button", {type: "button", class: "key", "aria-pressed": String(!hidden.has(r)), title: `Show or hide ${name} in the charts`, on: {click: () => { if (hidden.has(r)) hidden.delete(r); else hidden.add(r); showRobots(); redraw(); }}}, chip(r), name)})));
  const more = R - K;
  if (more > 0 && !at("robot_legend").dataset.more) { at("robot_legend").dataset.more = "1"; at("robot_legend").after(el("span", {class: "muted"}, `${K} of ${R} robots`)); }
}

function showFaults() {
  const rows = board.faults.map((one) => {
    const when = one.to_s === null || one.to_s === undefined ? `from ${number(one.from_s, 2)} s` : one.to_s === one.from_s ? `at ${number(one.from_s, 2)} s` : `${number(one.from_s, 2)}–${number(one.to_s, 2)} s`;
    const going = one.state === "acting" || one.state === "planned";
    return {key: [one, going && board.controls.yours], make: () => el("li", {class: one.state === "acting" ? "open" : ""}, el("span", {class: "mark"}, {acting: "!", planned: "○", over: "·", cleared: "✓"}[one.state] || ""),
      el("span", {}, el("b", {}, one.name), ` ${one.kind === one.name ? "" : one.kind} `, el("span", {class: "muted"}, `${one.targets.join(", ")} · ${one.state}, ${when}`)),
      going ? el("button", {type: "button", class: "small controls-only", disabled: !board.controls.yours, on: {click: () => order("fault.clear", {names: [one.name]})}}, "Clear") : null)};
  });
  fill(at("faults"), rows.length ? rows : [{key: "none", make: () => el("li", {class: "muted"}, "None.")}]);
  at("clear").hidden = !board.faults.some((one) => one.state === "acting" || one.state === "planned");
}

function showProcesses() {
  const table = at("processes");
  if (!table.tHead) table.append(el("thead", {}, el("tr", {}, el("th", {}, "process"), el("th", {}, "state"), el("th", {class: "num"}, "tick"), el("th", {class: "num", title: "Processor time of a tick"}, "CPU per tick"), el("th", {class: "num"}, "CPU"))), el("tbody"));
  const rows = (board.run.processes || []).map((one) => ({key: one, make: () => el("tr", {class: one.state === "up" || one.state === "ended" ? "" : "open"}, el("th", {scope: "row"}, one.name), el("td", {}, one.waited_for && !board.ended ? el("b", {class: "waited"}, "waited for") : one.state),
    el("td", {class: "num"}, one.tick ?? "–"), el("td", {class: "num"}, finite(one.cpu) && board.run.real_time_factor > 0 ? `${number(1e6 * one.cpu * facts.period_s / board.run.real_time_factor, 0)} µs` : "–"), el("td", {class: "num"}, finite(one.cpu) ? share(one.cpu) : "–"))}));
  fill(table.tBodies[0], rows);
}

function showEvents() {
  const list = at("events"), low = list.scrollHeight - list.scrollTop - list.clientHeight < 30;
  const fresh = board.events.items.slice(Math.max(0, known_events - board.events.first));
  for (const one of fresh) {
    list.append(el("li", {class: {error: "failed", warning: "open"}[one.gravity]}, el("span", {class: "num muted"}, `${number(one.t_s, 3)} s`), el("b", {}, one.source), el("span", {}, one.kind.replaceAll("_", " "), one.text ? el("span", {class: "muted"}, ` ${one.text}`) : null)));
  }
  known_events = Math.max(known_events, board.events.next);
  while (list.children.length > 500) list.firstChild.remove();
  if (low && fresh.length) list.scrollTop = list.scrollHeight;
}

function showEdgeLegend() {
  const key = (css, text) => el("span", {class: "key-item"}, el("span", {class: `line ${css}`, "aria-hidden": "true"}), text);
  at("edge_legend").append(key("fresh", "edge"), key("lossy", "loses"), key("dead", "dead"), el("span", {class: "key-item"}, el("span", {"aria-hidden": "true"}, "+"), "reference"));
}
