"use strict";
// Plots as SVG: frame, ticks inside, logarithmic or linear axes, lines, markers, error bars, and bars.

const SVG = "http://www.w3.org/2000/svg";
const INK = "#111", START = "#868686";
// Dark to light, so that they differ in grey too; so do the markers.
const COLOURS = ["#440154", "#3b528b", "#21908d", "#2f9e6e", "#5a9b1f", "#8a8a00"];
const MARKERS = ["circle", "square", "triangle", "diamond", "down", "cross"];
const FRAME = { width: 420, height: 292, left: 62, right: 12, top: 38, bottom: 44 };

function element(name, attributes, parent, text) {
  const made = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes || {})) made.setAttribute(key, value);
  if (text !== undefined) made.textContent = text;
  if (parent) parent.appendChild(made);
  return made;
}

// A name in parts [text, "i" italic | "" upright | "sub" | "sup"], such as h_rms or q0; {…} is upright.
function parts(label) {
  const symbols = { tau: "τ", gamma: "γ", mu: "μ", omega: "ω", hurst: "H", poisson: "ν", young: "E" };
  const match = /^([A-Za-z]+?)(?:_(\w+)|([0-9r]))?$/.exec(label);
  if (!match) return [[label, ""]];
  const base = symbols[match[1]] || match[1];
  const below = match[2] === "inf" ? "∞" : match[2] || match[3];
  if (base.length > 1) return [[label.replaceAll("_", " "), ""]];
  return below ? [[base, "i"], [below, "sub"]] : [[base, "i"]];
}

// Text of such parts in a plot.
function written(parent, attributes, pieces) {
  const text = element("text", attributes, parent);
  let shift = 0;
  for (const [content, kind] of pieces) {
    const wanted = kind === "sub" ? 3 : kind === "sup" ? -4.5 : 0;
    const style = {};
    if (wanted !== shift) style.dy = wanted - shift;
    if (kind === "sub" || kind === "sup") style["font-size"] = "75%";
    if (kind === "i") Object.assign(style, { "font-style": "italic", "font-family": "Times New Roman, Liberation Serif, serif", "font-size": "112%" });
    element("tspan", style, text, content);
    shift = wanted;
  }
  return text;
}

function minus(text) { return String(text).replace("-", "\u2212"); }

// A number as an axis writes it.
function number(x) {
  if (x === 0) return [["0", ""]];
  const size = Math.abs(x);
  if (size >= 1e-3 && size < 1e5) return [[minus(Number(x.toPrecision(6))), ""]];
  const power = Math.floor(Math.log10(size) + 1e-9), mantissa = Number((x / 10 ** power).toPrecision(3));
  const front = mantissa === 1 ? "10" : `${minus(mantissa)}·10`;
  return [[front, ""], [minus(power), "sup"]];
}

class Axis {
  constructor(low, high, logarithmic, from, to) {
    Object.assign(this, { low, high, logarithmic, from, to });
  }
  part(x) {
    const f = this.logarithmic ? Math.log : (y) => y;
    return (f(x) - f(this.low)) / (f(this.high) - f(this.low));
  }
  at(x) { return this.from + (this.to - this.from) * this.part(x); }
  // [value, whether it has a number]
  ticks() {
    if (!this.logarithmic) {
      const rough = (this.high - this.low) / 5, power = 10 ** Math.floor(Math.log10(rough));
      const step = [1, 2, 5, 10].map((m) => m * power).find((s) => s >= rough * 0.99);
      const found = [];
      for (let k = Math.ceil(this.low / step - 1e-9); k * step <= this.high + 1e-9 * step; k++) found.push([k * step, true]);
      return found;
    }
    const first = Math.floor(Math.log10(this.low) + 1e-9), last = Math.ceil(Math.log10(this.high) - 1e-9);
    const every = Math.ceil((last - first) / 6), few = this.high / this.low <= 30, found = [];
    for (let power = first; power <= last; power++)
      for (let m = 1; m < 10; m++) {
        const x = m * 10 ** power;
        if (x < this.low * (1 - 1e-9) || x > this.high * (1 + 1e-9)) continue;
        if (m === 1) found.push([x, power % every === 0]);
        else if (few) found.push([x, m === 2 || m === 5]);
        else if (every === 1) found.push([x, false]);
      }
    return found;
  }
}

class Plot {
  // look: { title: pieces, x: { label: pieces, logarithmic }, y: the same, zero: whether y begins at 0 }
  constructor(host, look) {
    this.look = look;
    const figure = document.createElement("figure");
    host.appendChild(figure);
    const { width, height } = FRAME;
    this.svg = element("svg", {
      viewBox: `0 0 ${width} ${height}`, xmlns: SVG, role: "img", "font-size": 11.5,
      "font-family": "Helvetica Neue, Arial, Liberation Sans, sans-serif", "data-panel": look.name,
    }, figure);
    // Screen readers read the names of the axes.
    const named = [look.y, look.x].filter(Boolean).map((axis) => axis.label.map(([text]) => text).join(""));
    this.svg.setAttribute("aria-label", named.join(" over "));
    this.limits = null;
    this.more = 0; // rows of keys beyond two [px]
  }

  // Limits that include the series, and what was shown before: a scale that jumps shows no change.
  fit(series) {
    const range = (values, logarithmic) => {
      let low = Infinity, high = -Infinity;
      for (const list of values) for (const x of list)
        if (x !== null && Number.isFinite(x) && (!logarithmic || x > 0)) { low = Math.min(low, x); high = Math.max(high, x); }
      return [low, high];
    };
    const { x, y } = this.look;
    const [left, right] = range(series.map((s) => s.x), x.logarithmic);
    let [low, high] = range(series.map((s) => s.y), y.logarithmic);
    if (!(left <= right) || !(low <= high)) return this.limits || { left: 1, right: 10, low: y.logarithmic ? 0.1 : 0, high: 1 };
    if (y.logarithmic) {
      low = Math.max(low, high / 10 ** (y.decades || 12));
      if (high / low < 3) { low /= 1.8; high *= 1.8; }
      low = 10 ** (Math.floor(4 * Math.log10(low / 1.05)) / 4);
      high = 10 ** (Math.ceil(4 * Math.log10(high * 1.05)) / 4);
    } else {
      if (this.look.zero) { low = Math.min(low, 0); high = Math.max(high, 0); }
      if (high === low) { high += Math.abs(high) * 0.1 || 1; if (!this.look.zero) low -= Math.abs(low) * 0.1 || 1; }
      const room = (high - low) * 0.06;
      const step = 10 ** Math.floor(Math.log10(high - low)) / 4;
      high = Math.ceil((high + room) / step) * step;
      low = this.look.zero && low === 0 ? 0 : Math.floor((low - room) / step) * step;
    }
    const now = { left, right, low, high }, before = this.limits;
    if (before) {
      now.left = Math.min(left, before.left); now.right = Math.max(right, before.right);
      now.low = Math.min(low, before.low); now.high = Math.max(high, before.high);
    }
    return (this.limits = now);
  }

  frame(limits) {
    this.svg.replaceChildren();
    const { width, left, right, bottom } = FRAME, { look, svg } = this;
    const top = FRAME.top + this.more, height = FRAME.height + this.more;
    svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
    Object.assign(this, { top, height });
    element("rect", { width, height, fill: "#fff" }, svg);
    const x = new Axis(limits.left, limits.right, look.x.logarithmic, left, width - right);
    const y = new Axis(limits.low, limits.high, look.y.logarithmic, height - bottom, top);
    this.x = x;
    const lines = [];
    for (const [value, named] of x.ticks()) {
      const at = x.at(value).toFixed(1), long = named ? 6 : 3;
      lines.push(`M${at} ${height - bottom}v${-long}M${at} ${top}v${long}`);
      if (named) written(svg, { x: at, y: height - bottom + 15, "text-anchor": "middle" }, tick(value, x));
    }
    for (const [value, named] of y.ticks()) {
      const at = y.at(value).toFixed(1), long = named ? 6 : 3;
      lines.push(`M${left} ${at}h${long}M${width - right} ${at}h${-long}`);
      if (named) written(svg, { x: left - 5, y: Number(at) + 4, "text-anchor": "end" }, tick(value, y));
    }
    if (!y.logarithmic && limits.low < 0 && limits.high > 0)
      element("path", { d: `M${left} ${y.at(0)}H${width - right}`, stroke: "#999", "stroke-width": 0.7 }, svg);
    element("path", { d: lines.join(""), stroke: INK, "stroke-width": 0.8, fill: "none" }, svg);
    element("rect", { x: left, y: top, width: width - left - right, height: height - top - bottom, fill: "none", stroke: INK }, svg);
    written(svg, { x: (left + width - right) / 2, y: height - 8, "text-anchor": "middle", "font-size": 12.5 }, look.x.label);
    const middle = (top + height - bottom) / 2;
    written(svg, { transform: `translate(14 ${middle}) rotate(-90)`, "text-anchor": "middle", "font-size": 12.5 }, look.y.label);
    const clip = `clip-${look.name}`;
    element("rect", { x: left, y: top, width: width - left - right, height: height - top - bottom }, element("clipPath", { id: clip }, svg));
    this.inside = element("g", { "clip-path": `url(#${clip})` }, svg);
    return [x, y];
  }

  // series: { name: pieces, x, y, errors, colour, dash, thick, marker, role }
  draw(series, mark) {
    const keys = this.keys(series.filter((s) => s.name)), limits = this.fit(series), [x, y] = this.frame(limits);
    const visible = (s, i) => s.y[i] !== null && s.y[i] !== undefined && Number.isFinite(s.y[i]) && (!this.look.y.logarithmic || s.y[i] > 0);
    if (mark) {
      const at = x.at(mark).toFixed(1);
      element("path", { d: `M${at} ${this.top}V${this.height - FRAME.bottom}`, stroke: "#777", "stroke-width": 0.9, "stroke-dasharray": "1.5 2.5" }, this.inside);
    }
    for (const s of series) {
      const colour = s.colour || INK;
      if (s.marker) {
        const bars = [], shapes = [];
        s.x.forEach((value, i) => {
          if (!visible(s, i)) return;
          const a = x.at(value), b = y.at(s.y[i]);
          shapes.push(shape(s.marker, a, b, 2.6));
          if (s.errors && s.errors[i]) {
            const lower = s.y[i] - s.errors[i];
            const low = this.look.y.logarithmic && lower <= 0 ? this.height : y.at(lower);
            bars.push(`M${a.toFixed(1)} ${low.toFixed(1)}V${y.at(s.y[i] + s.errors[i]).toFixed(1)}`);
          }
        });
        element("path", { d: bars.join(""), stroke: colour, "stroke-width": 0.7, opacity: 0.7 }, this.inside);
        element("path", { d: shapes.join(""), fill: "#fff", stroke: colour, "stroke-width": 1.1, "data-role": s.role || "" }, this.inside);
        continue;
      }
      let pen = "M", d = "";
      s.x.forEach((value, i) => {
        if (!visible(s, i)) { pen = "M"; return; }
        d += `${pen}${x.at(value).toFixed(2)} ${y.at(s.y[i]).toFixed(2)}`;
        pen = "L";
      });
      element("path", {
        d, fill: "none", stroke: colour, "stroke-width": s.thick || 1.8, "stroke-dasharray": s.dash || "none",
        "stroke-linejoin": "round", "data-role": s.role || "",
      }, this.inside);
    }
    this.legend(keys);
  }

  // Above the frame, in as many rows as it takes; places: [series, x, y].
  keys(series) {
    const room = FRAME.width - FRAME.left - FRAME.right, places = [];
    let at = 0, row = 0;
    for (const s of series) {
      const wide = 42 + 5.9 * s.name.map(([text]) => text.length).reduce((a, b) => a + b, 0);
      if (at && at + wide > room + 8) { at = 0; row += 1; }
      places.push([s, FRAME.left + at, 16 + 16 * row]);
      at += wide;
    }
    this.more = Math.max(0, 16 * (row - 1) + 8 * (row > 0));
    const down = row === 0 ? 11 : 0;
    return places.map(([s, x, y]) => [s, x, y + down]);
  }

  legend(series) {
    for (const [s, at, y] of series) {
      const colour = s.colour || INK;
      if (!s.marker || s.both)
        element("path", { d: `M${at} ${y - 4}h22`, stroke: colour, "stroke-width": s.thick || 1.8, "stroke-dasharray": s.dash || "none" }, this.svg);
      if (s.marker) element("path", { d: shape(s.marker, at + 11, y - 4, 2.9), fill: "#fff", stroke: colour, "stroke-width": 1.1 }, this.svg);
      written(this.svg, { x: at + 26, y, "font-size": 11 }, s.name);
    }
  }

  // rows: [pieces, value], largest first; filled to the right, hatched to the left
  bars(rows, label) {
    const { width, height, top, bottom } = FRAME, left = 150, right = 12, svg = this.svg;
    svg.replaceChildren();
    element("rect", { width, height, fill: "#fff" }, svg);
    const hatch = element("pattern", { id: "hatch", width: 4, height: 4, patternUnits: "userSpaceOnUse", patternTransform: "rotate(45)" }, element("defs", {}, svg));
    element("rect", { width: 4, height: 4, fill: "#fff" }, hatch);
    element("path", { d: "M0 0V4", stroke: INK, "stroke-width": 1.6 }, hatch);
    const most = Math.max(...rows.map((row) => Math.abs(row[1])), 1e-9);
    const low = rows.some((row) => row[1] < 0) ? -1.4 * most : 0;
    const x = new Axis(low, 1.3 * most, false, left, width - right);
    const lines = [];
    for (const [value] of x.ticks()) {
      const at = x.at(value).toFixed(1);
      lines.push(`M${at} ${height - bottom}v-6`);
      written(svg, { x: at, y: height - bottom + 15, "text-anchor": "middle" }, number(Number(value.toPrecision(6))));
    }
    element("path", { d: lines.join(""), stroke: INK, "stroke-width": 0.8 }, svg);
    const step = (height - top - bottom) / Math.max(rows.length, 1), thick = Math.min(step * 0.66, 13);
    rows.forEach(([name, value], i) => {
      const middle = top + step * (i + 0.5), a = x.at(Math.min(value, 0)), b = x.at(Math.max(value, 0));
      element("rect", { x: a, y: middle - thick / 2, width: Math.max(b - a, 0.5), height: thick, fill: value < 0 ? "url(#hatch)" : "#555", stroke: INK, "stroke-width": 0.7 }, svg);
      written(svg, { x: left - 6, y: middle + 4, "text-anchor": "end", "font-size": 11 }, name);
      const text = minus(value.toFixed(2));
      const outside = value < 0 ? { x: a - 3, "text-anchor": "end" } : { x: b + 3, "text-anchor": "start" };
      written(svg, { ...outside, y: middle + 4, "font-size": 10.5 }, [[text, ""]]);
    });
    element("path", { d: `M${x.at(0)} ${top}V${height - bottom}`, stroke: INK, "stroke-width": 0.8 }, svg);
    element("rect", { x: left, y: top, width: width - left - right, height: height - top - bottom, fill: "none", stroke: INK }, svg);
    written(svg, { x: (left + width - right) / 2, y: height - 8, "text-anchor": "middle", "font-size": 12.5 }, this.look.x.label);
    written(svg, { x: left, y: 27, "font-size": 11 }, label);
  }

  say(text) {
    this.svg.replaceChildren();
    element("rect", { width: FRAME.width, height: FRAME.height, fill: "#fff" }, this.svg);
    element("text", { x: FRAME.width / 2, y: FRAME.height / 2, "text-anchor": "middle", fill: "#555" }, this.svg, text);
  }

  // The x of a place on the screen.
  place(event) {
    const box = this.svg.getBoundingClientRect();
    const part = ((event.clientX - box.left) / box.width * FRAME.width - this.x.from) / (this.x.to - this.x.from);
    const { low, high } = this.x, limited = Math.min(Math.max(part, 0), 1);
    return this.x.logarithmic ? low * (high / low) ** limited : low + (high - low) * limited;
  }
}

// A tick of an axis over decades is a power of ten, whatever its size.
function tick(value, axis) {
  if (axis.logarithmic && axis.high / axis.low > 30) return [["10", ""], [minus(Math.round(Math.log10(value))), "sup"]];
  return number(Number(value.toPrecision(6)));
}

function shape(kind, x, y, r) {
  const p = (...points) => `M${points.map(([a, b]) => `${(x + a * r).toFixed(1)} ${(y + b * r).toFixed(1)}`).join("L")}Z`;
  if (kind === "square") return p([-0.9, -0.9], [0.9, -0.9], [0.9, 0.9], [-0.9, 0.9]);
  if (kind === "triangle") return p([0, -1.2], [1.1, 0.8], [-1.1, 0.8]);
  if (kind === "down") return p([0, 1.2], [1.1, -0.8], [-1.1, -0.8]);
  if (kind === "diamond") return p([0, -1.3], [1.3, 0], [0, 1.3], [-1.3, 0]);
  if (kind === "cross") return `M${(x - r).toFixed(1)} ${(y - r).toFixed(1)}l${2 * r} ${2 * r}M${(x - r).toFixed(1)} ${(y + r).toFixed(1)}l${2 * r} ${-2 * r}`;
  return `M${(x - r).toFixed(1)} ${y.toFixed(1)}a${r} ${r} 0 1 0 ${2 * r} 0a${r} ${r} 0 1 0 ${-2 * r} 0Z`;
}
