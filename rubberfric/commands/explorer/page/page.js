"use strict";
// Sliders to the left, plots to the right. While one answer is on its way no other is asked for: the next
// question has the sliders where they are by then, and those in between are never asked. Of scenes that take long
// a draft is asked for while a slider moves, and the curves themselves when it has come to rest.

const ROOT = location.pathname, $ = (id) => document.getElementById(id);
const state = { values: {}, start: null, first: null, shown: null, slopes: null, mark: 0, busy: false, wanted: false, idle: 0, moved: -Infinity, draft: null, off: null };
const rows = {}, panels = {};
const REST = 250; // after which a slider is at rest [ms]
const DASHES = ["none", "6 2", "2 2"]; // of curves beside measured points

async function post(route, body) {
  const answer = await fetch(ROOT + route, {
    method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(body || {}),
  });
  if (!answer.ok) throw new Error(await answer.text());
  return answer;
}

// ---- sliders

function toPart(s, value) {
  return s.logarithmic ? Math.log(value / s.low) / Math.log(s.high / s.low) : (value - s.low) / (s.high - s.low);
}

function toValue(s, part) {
  const value = s.logarithmic ? s.low * (s.high / s.low) ** part : s.low + (s.high - s.low) * part;
  return Math.min(Math.max(value, s.low), s.high);
}

function short(value) {
  const size = Math.abs(value);
  if (size !== 0 && (size < 1e-2 || size >= 1e5)) return value.toExponential(3).replace(/\.?0+e/, "e").replace("e+", "e");
  return String(Number(value.toPrecision(5)));
}

function set(name, value, from) {
  const { slider, range, box, unit, reset, row } = rows[name];
  state.values[name] = value;
  if (from !== range) range.value = Math.round(1000 * toPart(slider, value));
  if (from !== box) box.value = short(value);
  unit.textContent = unitOf(slider, value);
  range.setAttribute("aria-valuetext", `${short(value)} ${unit.textContent}`.trim());
  const moved = value !== slider.start;
  reset.disabled = !moved;
  row.classList.toggle("moved", moved);
  ask();
}

function unitOf(slider, value) {
  if (slider.name === "temperature") return `K (${minus((value - 273.15).toFixed(0))} °C)`;
  if (slider.unit === "") return "×";
  return slider.unit === "-" ? "" : slider.unit.replace("^2", "²").replace("^3", "³");
}

function make(tag, properties, parent) {
  const made = Object.assign(document.createElement(tag), properties);
  if (parent) parent.appendChild(made);
  return made;
}

function groupOf(slider) {
  const decade = /^(.*), tau 1e(-?\d+) s$/.exec(slider.label);
  if (!decade) return [slider.group, slider.label, true];
  const power = Number(decade[2]), sup = (n) => String(n).replace(/./g, (c) => "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"["-0123456789".indexOf(c)]);
  return [`${slider.group}, ${decade[1]} by decade of τ`, `τ ≥ 10${sup(power)} s`, false];
}

function makeSlider(slider) {
  const [group, label, open] = groupOf(slider);
  let host = document.querySelector(`details[data-group="${CSS.escape(group)}"]`);
  if (!host) {
    host = make("details", { open }, $("sliders"));
    host.dataset.group = group;
    make("summary", { textContent: group.replaceAll(".", " · ") }, host);
  }
  const row = make("div", { className: "slider" }, host), id = `range ${slider.name}`;
  row.dataset.name = slider.name;
  const title = `${slider.name}, ${short(slider.low)} … ${short(slider.high)} ${slider.unit || "×"}`;
  const name = make("label", { title, htmlFor: id }, row);
  for (const [textContent, kind] of parts(label)) make(kind || "span", { textContent }, name);
  const range = make("input", { type: "range", min: 0, max: 1000, step: 1, id }, row);
  const box = make("input", { type: "text", inputMode: "decimal" }, row);
  box.setAttribute("aria-label", slider.name);
  const unit = make("span", { className: "unit" }, row);
  const reset = make("button", { type: "button", textContent: "↺", title: `back to ${short(slider.start)}` }, row);
  rows[slider.name] = { slider, range, box, unit, reset, row };
  range.addEventListener("input", () => {
    state.moved = performance.now();
    set(slider.name, toValue(slider, range.value / 1000), range);
  });
  reset.addEventListener("click", () => set(slider.name, slider.start));
  box.addEventListener("change", () => {
    const value = Number(box.value.replace(",", "."));
    if (box.value.trim() && value >= slider.low && value <= slider.high) set(slider.name, value, box);
    else {
      complain(`${slider.name} = ${box.value}: must be between ${short(slider.low)} and ${short(slider.high)} ${slider.unit}`);
      box.value = short(state.values[slider.name]);
    }
  });
}

// ---- asking

function away() {
  const found = {};
  for (const s of state.start.sliders) if (state.values[s.name] !== s.start) found[s.name] = state.values[s.name];
  return found;
}

function complain(text) { $("error").textContent = text; }

async function ask() {
  state.wanted = true;
  if (state.busy) return;
  state.busy = true;
  while (state.wanted) {
    state.wanted = false;
    const draft = state.start.drafts && performance.now() - state.moved < REST;
    const begin = performance.now(), late = setTimeout(() => { $("status").textContent = "computing …"; }, 300);
    try {
      const values = away(), answer = await post(draft ? "drafts" : "curves", values);
      const found = await answer.json();
      state.start.drafts = found.drafts;
      compare(values, found, draft);
      state.shown = found;
      state.first = state.first || found;
      complain("");
      drawCurves();
      tell(performance.now() - begin, answer.headers.get("Server-Timing"), draft);
    } catch (error) {
      complain(error.message);
    } finally {
      clearTimeout(late);
    }
    document.documentElement.dataset.answers = Number(document.documentElement.dataset.answers || 0) + 1;
    document.documentElement.dataset.draft = draft ? "yes" : "no";
  }
  state.busy = false;
  clearTimeout(state.idle);
  const drafted = document.documentElement.dataset.draft === "yes";
  // Timers may fire a little early, and a slider that is not at rest yet would have one more draft.
  const rest = Math.max(0, state.moved + REST - performance.now()) + 10;
  state.idle = drafted ? setTimeout(ask, rest) : setTimeout(askSlopes, 120);
}

// How far the last draft was off, when the curves of the same numbers are there.
function compare(values, found, draft) {
  const key = JSON.stringify(values), name = state.start.sensitive;
  if (draft) state.draft = { key, curve: found.curves[name] };
  else if (state.draft && state.draft.key === key) {
    const curve = found.curves[name], most = Math.max(...curve.map(Math.abs));
    state.off = Math.max(...curve.map((value, i) => Math.abs(value - state.draft.curve[i]))) / most;
  }
}

async function askSlopes() {
  if (state.busy) return;
  try {
    const found = await (await post("sensitivities", away())).json();
    if (found.pending) {
      // Differences come slider by slider, and derivatives replace them.
      const all = Object.keys(found.sensitivities).length === state.start.sliders.length;
      state.idle = setTimeout(askSlopes, all ? 1000 : 50);
    }
    state.slopes = found.sensitivities;
    drawSlopes();
    document.documentElement.dataset.exact = found.pending ? "no" : "yes";
  } catch (error) {
    complain(error.message);
  }
}

function tell(spent, server, draft) {
  const inside = /dur=([\d.]+)/.exec(server || "");
  let text = `${spent.toFixed(0)} ms${inside ? `, of which ${Number(inside[1]).toFixed(0)} computing` : ""}`;
  const left = (state.shown.curves.converged || []).filter((x) => !x).length;
  if (left) text = `no solution at ${left} of ${state.start.at.length} points; ${text}`;
  if (state.start.drafts) {
    const off = state.off === null ? "" : `, the last one was off by ${(100 * state.off).toPrecision(2)} %`;
    text = `${draft ? `preview${off}` : "full accuracy"}; ${text}`;
  }
  const misfit = state.shown.misfit;
  if (misfit !== undefined && misfit !== null) {
    const by = misfit < 0.3 ? `${(100 * misfit).toPrecision(2)} %` : `a factor of ${Math.exp(misfit).toPrecision(2)}`;
    text = `off the measured points by ${by} (rms); ${text}`;
  }
  $("status").textContent = text;
  document.documentElement.dataset.spent = spent.toFixed(1);
}

// ---- drawing

const upright = (text) => [text, ""], italic = (text) => [text, "i"], below = (text) => [text, "sub"], above = (text) => [text, "sup"];

function makePanels() {
  const host = $("panels"), { axis, at } = state.start, shown = state.first.curves;
  const x = axis === "velocity"
    ? { label: [upright("velocity "), italic("v"), upright(" [m/s]")], logarithmic: true }
    : { label: [upright("pressure "), italic("p"), upright(" [Pa]")], logarithmic: true };
  const wide = (values) => {
    const known = values.filter((value) => value > 0);
    return known.length === values.length && Math.max(...known) > 8 * Math.min(...known);
  };
  const add = (name, label, values, options) => {
    const look = { name, x, y: { label, logarithmic: wide(values) }, zero: true, ...options };
    panels[name] = new Plot(host, look);
    panels[name].svg.addEventListener("click", (event) => {
      const to = panels[name].place(event), every = state.start.every;
      const near = at.filter((_, i) => i % every === 0).map((value) => Math.abs(Math.log(value / to)));
      state.mark = near.indexOf(Math.min(...near));
      drawCurves();
      drawSlopes();
    });
  };
  if (state.start.sensitive === "friction") add("friction", [upright("friction coefficient "), italic("μ")], [0]);
  add("area", [upright("contact area "), italic("A"), upright("/"), italic("A"), below("0")], shown.area);
  if (shown.flash_temperature) add("flash_temperature", [upright("flash temperature [°C]")], [0], { zero: false });
  else if (shown.transverse_friction) add("transverse_friction", [upright("transverse friction "), italic("μ"), below("⊥")], [0]);
  else if (shown.separation) add("separation", [upright("mean separation "), italic("ū"), upright(" [µm]")], shown.separation);
  if (Object.keys(state.start.omega).length)
    panels.moduli = new Plot(host, {
      name: "moduli", x: { label: [upright("angular frequency "), italic("ω"), upright(" [rad/s]")], logarithmic: true },
      y: { label: [italic("E′"), upright(", "), italic("E″"), upright(" at reference "), italic("T"), upright(" [Pa]")], logarithmic: true, decades: 9 },
    });
  if (Object.keys(state.first.spectra).length)
    panels.spectra = new Plot(host, {
      name: "spectra", x: { label: [upright("wavevector "), italic("q"), upright(" [1/m]")], logarithmic: true },
      y: { label: [upright("power spectrum "), italic("C"), upright(" [m"), above("4"), upright("]")], logarithmic: true, decades: 30 },
    });
  const of = state.start.sensitive === "friction" ? [italic("μ")] : [upright("("), italic("A"), upright("/"), italic("A"), below("0"), upright(")")];
  panels.slopes = new Plot(host, { name: "sensitivities", x: { label: [upright("sensitivity d ln "), ...of, upright(" / d ln "), italic("θ")] } });
  panels.slopes.say("sensitivities: being computed");
}

function condition(curve) {
  const found = [];
  if (curve.pressure !== null) found.push(`${short(curve.pressure / 1e6)} MPa`);
  if (curve.temperature !== null) found.push(`${minus((curve.temperature - 273.15).toFixed(0))} °C`);
  return found.join(", ") || "measured";
}

function before(x, y, now) {
  const same = y.every((value, i) => value === now[i]);
  return same ? [] : [{ name: [upright("start")], x, y, colour: START, dash: "6 3", thick: 1.3, role: "start" }];
}

// The key of a grey line, if there is none yet.
function began(series) { return series.some((s) => s.colour === START) ? null : [upright("start")]; }

function drawCurves() {
  // Back at the start, the axes have their first limits again.
  if (!Object.keys(away()).length) for (const plot of Object.values(panels)) plot.limits = null;
  const { at, beside, points } = state.start, now = state.shown, first = state.first.curves, mark = at[state.mark * state.start.every];
  const good = (name, scale) => (all) => all[name].map((value, i) => (value === null || (all.converged && !all.converged[i]) ? null : scale(value)));
  const scales = { separation: (x) => 1e6 * x, flash_temperature: (x) => x - 273.15 };
  for (const name of ["friction", "area", "flash_temperature", "transverse_friction", "separation"]) {
    if (!panels[name]) continue;
    const pick = good(name, scales[name] || ((x) => x)), y = pick(now.curves);
    const series = before(at, pick(first), y);
    if (name === "friction" && points)
      points.curves.forEach((curve, i) => {
        // As in other pictures, temperatures differ in colour, pressures in line style and marker.
        const rank = (name) => [...new Set(points.curves.map((one) => one[name]))].sort((a, b) => a - b);
        const p = rank("pressure"), T = rank("temperature"), tones = T.length > 1 ? T : p;
        const tone = tones.indexOf(T.length > 1 ? curve.temperature : curve.pressure), sign = p.indexOf(curve.pressure);
        const colour = COLOURS[Math.floor(tone * COLOURS.length / tones.length)];
        const marker = MARKERS[(p.length > 1 ? sign : tone) % MARKERS.length], dash = DASHES[sign % DASHES.length];
        series.push({ x: beside, y: now.beside[i], colour, thick: 1, dash, role: "beside" });
        const of = (list) => curve.points.map((k) => list[k]);
        series.push({ name: [upright(condition(curve))], x: of(points.velocity), y: of(points.friction), errors: points.error && of(points.error), colour, marker, both: true, thick: 1, dash, role: "measured" });
      });
    series.push({ name: series.length ? [upright("now")] : null, x: at, y, role: "now" });
    if (name === "friction" && now.curves.shear_friction) {
      series[series.length - 1].name = [upright("now")];
      series.push({ name: [upright("viscoelastic")], x: at, y: now.curves.viscoelastic_friction, dash: "7 3", thick: 1.2 });
      series.push({ name: [upright("contact shear")], x: at, y: now.curves.shear_friction, dash: "1.5 2.5", thick: 1.5 });
    }
    panels[name].draw(series, mark);
  }
  if (panels.moduli) {
    const series = [], several = Object.keys(now.moduli).length > 1, colours = [INK, "#2a78b5", "#c26a00"];
    Object.entries(now.moduli).forEach(([name, [storage, loss]], i) => {
      const omega = state.start.omega[name], of = several ? ` ${name}` : "", old = state.first.moduli[name];
      if (old[0].some((value, k) => value !== storage[k]) || old[1].some((value, k) => value !== loss[k])) {
        series.unshift({ name: began(series), x: omega, y: old[0], colour: START, thick: 1.2 });
        series.unshift({ x: omega, y: old[1], colour: START, thick: 1.2, dash: "6 3" });
      }
      series.push({ name: [italic("E′"), upright(of)], x: omega, y: storage, colour: colours[i % 3], role: "now" });
      if (loss.some((value) => value > 0)) series.push({ name: [italic("E″"), upright(of)], x: omega, y: loss, colour: colours[i % 3], dash: "6 3" });
    });
    panels.moduli.draw(series);
  }
  if (panels.spectra) {
    const series = [], several = Object.keys(now.spectra).length > 1;
    Object.entries(now.spectra).forEach(([name, [q, C]], i) => {
      const [q0, C0] = state.first.spectra[name];
      if (q0.some((value, k) => value !== q[k]) || C0.some((value, k) => value !== C[k]))
        series.unshift({ name: began(series), x: q0, y: C0, colour: START, dash: "6 3", thick: 1.3 });
      series.push({ name: several ? [upright(name)] : null, x: q, y: C, dash: i ? "7 3" : "none", colour: i ? "#2a78b5" : INK, role: "now" });
    });
    if (series.length > 1 && !several) series[series.length - 1].name = [upright("now")];
    panels.spectra.draw(series);
  }
}

function drawSlopes() {
  if (!state.slopes) return;
  const found = [];
  for (const slider of state.start.sliders) {
    const value = (state.slopes[slider.name] || [])[state.mark];
    if (value === undefined || value === null || !(Math.abs(value) >= 0.005)) continue;
    const [group, label] = groupOf(slider), owner = group.split(/[.,]/)[0], base = group.includes("base") ? " base" : "";
    const front = owner === "conditions" || owner === "scene" ? "" : `${owner}${base} · `;
    const decade = label.startsWith("τ") ? [upright(`E, ${label}`)] : parts(label);
    found.push([[upright(front), ...decade], value]);
  }
  found.sort((a, b) => Math.abs(b[1]) - Math.abs(a[1]));
  const at = number(Number(state.start.at[state.mark * state.start.every].toPrecision(2)));
  const where = state.start.axis === "velocity" ? [italic("v"), upright(" = "), ...at, upright(" m/s")] : [italic("p"), upright(" = "), ...at, upright(" Pa")];
  panels.slopes.bars(found.slice(0, 12), [upright("at "), ...where, upright(" (a click moves it)")]);
  document.documentElement.dataset.slopes = found.length;
}

// ---- downloads

function save(content, name) {
  const link = make("a", { href: URL.createObjectURL(content), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}

async function download(route) {
  try {
    const answer = await post(route, away());
    const name = /filename="([^"]+)"/.exec(answer.headers.get("Content-Disposition"))[1];
    save(await answer.blob(), name);
    complain("");
    return name;
  } catch (error) {
    complain(error.message);
    return null;
  }
}

function note(lines, command) {
  const host = $("note");
  host.replaceChildren();
  for (const line of lines) make("div", { textContent: line }, host);
  if (command) make("pre", { textContent: command }, host);
  make("button", { type: "button", textContent: "close", onclick: () => { host.hidden = true; } }, host);
  host.hidden = false;
}

function savePictures() {
  for (const plot of Object.values(panels)) {
    const text = new XMLSerializer().serializeToString(plot.svg);
    save(new Blob([text], { type: "image/svg+xml" }), `${plot.look.name}.svg`);
  }
}

// ---- beginning

// The first curves, which are compiled while the page is shown.
async function compiledCurves() {
  const begin = performance.now();
  for (;;) {
    const found = await (await post("curves")).json();
    if (!found.pending) return found;
    $("status").textContent = `compiling the curves, ${((performance.now() - begin) / 1000).toFixed(0)} s …`;
    await new Promise((done) => setTimeout(done, 250));
  }
}

async function begin() {
  state.start = await (await post("start")).json();
  const { title, sliders, at, every } = state.start;
  if (title) {
    $("title").textContent = title;
    document.title = `${title} – rubberfric explore`;
  }
  state.mark = Math.floor(at.length / every / 2);
  for (const slider of sliders) {
    state.values[slider.name] = slider.start;
    makeSlider(slider);
  }
  state.busy = true; // the first answer makes the panels
  for (const slider of sliders) set(slider.name, slider.start);
  state.first = state.shown = await compiledCurves();
  makePanels();
  state.busy = false;
  ask();
  $("reset").addEventListener("click", () => {
    for (const slider of sliders) if (state.values[slider.name] !== slider.start) set(slider.name, slider.start);
  });
  $("scene").addEventListener("click", () => download("scene"));
  $("pictures").addEventListener("click", savePictures);
  $("fit").disabled = !state.start.points;
  if (!state.start.points) $("fit").title = "needs measured points: rubberfric explore SCENE --data FILE";
  $("fit").addEventListener("click", async () => {
    const name = await download("fit");
    if (name) note(["A job, the scene as it is now and the points; what was moved is free. Unpack it, and:"], `unzip ${name}\n${state.start.command}`);
  });
}

begin().catch((error) => complain(error.message));
