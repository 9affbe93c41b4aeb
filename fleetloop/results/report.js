/* The controls of report.html: what is shown, the window of time, the plane in motion.
   Plots are Bokeh's; their tags are those of fleetloop/results/plots.py and plane_plot.py. */
"use strict";
(() => {
  const off = new Set();
  let models = [], time = null, whole = null, plane = null, playing = 0, now = 0;
  const all = (query) => [...document.querySelectorAll(query)];
  const tagged = (model, tag) => Array.isArray(model.tags) && model.tags.includes(tag);

  function show() {
    for (const model of models) {
      if (model.type === "GlyphRenderer" && model.tags?.length)
        model.visible = !model.tags.some((tag) => off.has(tag));
    }
    for (const box of all("[data-group]")) box.hidden = off.has(box.dataset.group);
    for (const chip of all(".chip")) chip.setAttribute("aria-pressed", !off.has(chip.dataset.toggle));
    follow();
    seek(now);
  }

  function toggle(group, only) {
    if (only) {
      const others = all(".chip[data-toggle^='robot:']").map((chip) => chip.dataset.toggle);
      const alone = !off.has(group) && others.every((one) => one === group || off.has(one));
      for (const one of others) alone || one === group ? off.delete(one) : off.add(one);
    } else off.has(group) ? off.delete(group) : off.add(group);
    show();
  }

  /* A y axis spans what is seen of its lines in the window of time, not less than its floor. */
  function extent(plot, from, to, log) {
    let low = Infinity, high = -Infinity;
    const levels = [];
    const take = (v) => { if (Number.isFinite(v) && !(log && v <= 0)) { low = Math.min(low, v); high = Math.max(high, v); } };
    for (const one of plot.renderers) {
      if (one.type !== "GlyphRenderer" || !one.visible) continue;
      const data = one.data_source.data, get = (name) => data.get ? data.get(name) : data[name];
      if (tagged(one, "bounds")) {
        const y = get("y"), x0 = get("x0"), x1 = get("x1");
        for (let n = 0; x0 && n < y.length; n++) if (x0[n] <= to && x1[n] >= from) levels.push(y[n]);
        continue;
      }
      const t = get("t");
      if (!t) continue;
      for (const name of ["v", "low", "high"]) {
        const v = get(name);
        for (let n = 0; v && n < t.length; n++) {
          const next = n + 1 < t.length && t[n] < from && t[n + 1] > from;
          if ((t[n] >= from && t[n] <= to) || next) take(v[n]);
        }
      }
    }
    if (low <= high) {
      const near = 10 * (high - low || Math.abs(high));
      for (const y of levels) if (y >= low - near && y <= high + near) take(y);
    }
    return [low, high];
  }

  function follow() {
    if (!time) return;
    const from = time.start, to = time.end, full = from <= whole[0] && to >= whole[1];
    for (const plot of models) {
      if (plot.type !== "Figure" || !tagged(plot, "follow")) continue;
      const [, floor, log, lowest, highest] = plot.tags;
      let [low, high] = full && !off.size ? [lowest, highest] : extent(plot, from, to, log);
      if (!(low <= high)) continue;
      if (!full || off.size) {
        if (log) {  // whole decades, which have the labels
          low = 10 ** Math.floor(Math.log10(low)); high = 10 ** Math.ceil(Math.log10(Math.max(high, 2 * low, floor)));
        }
        else {
          const lack = Math.max(0, floor - (high - low)) / 2, pad = 0.06 * Math.max(high - low, floor);
          low -= lack + pad; high += lack + pad;
        }
      }
      plot.y_range.setv({ start: low, end: high });
    }
  }

  function window_of(button) {
    const [from, to] = button.dataset.window.split(" ").map(Number);
    time.setv({ start: from, end: to });
  }

  /* --- the plane --------------------------------------------------------------------------- */

  function seek(t) {
    if (!plane) return;
    const [, dt, size, outline, frames, robots, edges, windows] = plane.tags;
    const get = (source, name) => source.data.get ? source.data.get(name) : source.data[name];
    const x = get(frames, "x_m"), y = get(frames, "y_m"), heading = get(frames, "theta_rad");
    const count = get(robots, "name").length, last = x.length / count - 1;
    const place = Math.min(Math.max(t / dt, 0), last), k = Math.min(Math.floor(place), Math.max(last - 1, 0));
    const part = last ? place - k : 0, next = last ? k + 1 : k;
    const between = (values, n) => values[k * count + n] * (1 - part) + values[next * count + n] * part;
    const [px, py] = [get(robots, "x"), get(robots, "y")], [xs, ys] = [get(robots, "xs"), get(robots, "ys")];
    const group = get(robots, "group"), alpha = get(robots, "alpha");
    now = t;
    for (let n = 0; n < count; n++) {
      alpha[n] = off.has(group[n]) ? 0 : 0.85;
      const h = between(heading, n), c = Math.cos(h), s = Math.sin(h);
      px[n] = between(x, n); py[n] = between(y, n);
      xs[n] = outline.map(([a, b]) => px[n] + size * (a * c - b * s));
      ys[n] = outline.map(([a, b]) => py[n] + size * (a * s + b * c));
    }
    const a = get(edges, "a"), b = get(edges, "b"), set = (name, n, value) => { get(edges, name)[n] = value; };
    for (let n = 0; n < a.length; n++) {
      const [x0, y0, x1, y1] = [px[a[n]], py[a[n]], px[b[n]], py[b[n]]];
      set("x0", n, x0); set("y0", n, y0); set("x1", n, x1); set("y1", n, y1);
      set("xm", n, 0.4 * x0 + 0.6 * x1); set("ym", n, 0.4 * y0 + 0.6 * y1);
      set("angle", n, Math.atan2(y1 - y0, x1 - x0) - Math.PI / 2);
      set("alpha", n, alpha[a[n]] && alpha[b[n]] && (!windows[n] || windows[n].some(([from, to]) => from <= t && t < to)) ? 0.8 : 0);
    }
    robots.change.emit(); edges.change.emit();
    for (const model of models) if (model.name === "now") model.location = t;
    const slider = document.getElementById("seek");
    if (slider) slider.value = t;
    const shown = document.getElementById("now");
    if (shown) shown.textContent = `${t.toFixed(2)} s`;
  }

  function play() {
    const button = document.getElementById("play"), slider = document.getElementById("seek");
    if (playing) { cancelAnimationFrame(playing); playing = 0; button.textContent = "▶"; button.setAttribute("aria-label", "play"); return; }
    button.textContent = "❚❚"; button.setAttribute("aria-label", "pause");
    let t = Number(slider.value) >= Number(slider.max) ? 0 : Number(slider.value), before = performance.now();
    const step = (now) => {
      t += (now - before) / 1000 * Number(document.getElementById("speed").value);
      before = now;
      if (t >= Number(slider.max)) { seek(Number(slider.max)); playing = requestAnimationFrame(() => {}); play(); return; }
      seek(t);
      playing = requestAnimationFrame(step);
    };
    playing = requestAnimationFrame(step);
  }

  /* --- the beginning ----------------------------------------------------------------------- */

  function repaint() {
    for (const view of Bokeh.index.query(() => true)) if (view.model?.type === "Figure") { view.invalidate_painters?.(); view.request_repaint?.(); }
  }

  function begin() {
    models = Bokeh.documents.flatMap((one) => [...one.all_models]);
    time = models.find((model) => model.name === "time") ?? null;
    plane = models.find((model) => tagged(model, "plane")) ?? null;
    if (time) {
      whole = [time.start, time.end];
      let waiting = 0;
      time.change.connect(() => { waiting ||= requestAnimationFrame(() => { waiting = 0; follow(); }); });
    }
    if (matchMedia("(pointer: coarse)").matches)
      for (const model of models) if (model.type === "Figure") model.toolbar.active_drag = null;
    document.addEventListener("click", (event) => {
      const chip = event.target.closest(".chip"), button = event.target.closest("[data-window]");
      if (chip) toggle(chip.dataset.toggle, event.shiftKey);
      if (button && time) window_of(button);
      if (event.target.id === "play") play();
    });
    document.getElementById("seek")?.addEventListener("input", (event) => seek(Number(event.target.value)));
    document.addEventListener("themechange", repaint);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", repaint);
    if (plane) seek(0);
    document.documentElement.dataset.ready = "yes";
  }

  window.fleetloop = { seek, toggle, begin };
  const wait = () => { Bokeh.documents.length && Bokeh.documents[0].is_idle ? begin() : setTimeout(wait, 30); };
  document.readyState === "loading" ? document.addEventListener("DOMContentLoaded", wait) : wait();
})();
