"use strict";
// Maps that answer. Each .live element has a canvas, tools, a card and a place for chosen frames; its data lies at the end of the page in elements of
// their own (data-map, data-sheet): columns and places as base64 of little-endian numbers, frames on sprite sheets.
const VIRIDIS = ["#440154", "#482878", "#3e4989", "#31688e", "#26828e", "#1f9e89", "#35b779", "#6ece58", "#b5de2b", "#fde725"];
const KINDS = ["#3f90da", "#ffa90e", "#bd1f01", "#004b2d", "#832db6", "#a96b59", "#e76300", "#b9ac70", "#19193c", "#0fc3e1"];
const NONE = "#d0d0d0", MARK = "#d55e00", MOST_CHOSEN = 48;
const maps = [];

const bytes = text => Uint8Array.from(atob(text), c => c.charCodeAt(0));
const floats = text => new Float32Array(bytes(text).buffer);
const whole = text => new Uint32Array(bytes(text).buffer);
const make = (tag, fields = {}, ...children) => {
  const element = Object.assign(document.createElement(tag), fields);
  element.append(...children);
  return element;
};
const short = v => !Number.isFinite(v) ? "–" : Number.isInteger(v) ? String(v) : Math.abs(v) >= 100 ? v.toFixed(0) : v.toPrecision(3);
// The range of the colours, as figures have it (figures/coloring/span.rs), and at which ends values lie outside: a few far from all others do not squeeze these.
const span = values => {
  const sorted = values.filter(v => Number.isFinite(v)).sort(), n = sorted.length;
  if (!n) return { low: Infinity, high: -Infinity, below: false, above: false };
  const out = n < 20 ? 0 : Math.ceil(n / 200), first = sorted[0], last = sorted[n - 1];
  const low = sorted[out], high = sorted[n - 1 - out], far = 0.3 * (high - low);
  const below = far > 0 && low - first > far, above = far > 0 && last - high > far;
  return { low: below ? low : first, high: above ? high : last, below, above };
};

class LiveMap {
  constructor(live) {
    this.live = live;
    const data = JSON.parse(document.querySelector(`script[data-map="${live.id}"]`).textContent);
    this.data = data;
    this.x = floats(data.x); this.y = floats(data.y);
    this.episode = whole(data.episode); this.step = whole(data.step);
    this.columns = data.columns.map(c => ({ ...c, values: floats(c.values) }));
    this.alive = whole(data.alive); this.near = whole(data.near); this.distance = floats(data.distance);
    this.frameOf = new Map();
    const framed = whole(data.framed);
    framed.forEach((row, at) => this.frameOf.set(row, at));
    this.liveAt = new Map([...this.alive].map((row, at) => [row, at]));
    this.rowOf = new Map([...this.alive].map(row => [this.episode[row] + ":" + this.step[row], row]));
    this.sheets = [];
    this.canvas = live.querySelector("canvas.cloud");
    this.view = { zoom: 1, x: 0, y: 0 };
    this.chosen = -1; this.region = null; this.column = 0; this.pointers = new Map();
    this.tools(); this.mouse(); this.keys();
    new ResizeObserver(() => this.draw()).observe(this.canvas);
    this.paint(0);
  }

  part(name) { return this.live.querySelector(name); }

  tools() {
    const select = this.part("select");
    this.columns.forEach((column, i) => select.append(make("option", { value: i, textContent: column.name })));
    select.addEventListener("change", () => this.paint(Number(select.value)));
    this.part(".in").addEventListener("click", () => this.zoom(1.6));
    this.part(".out").addEventListener("click", () => this.zoom(1 / 1.6));
    this.part(".whole").addEventListener("click", () => { this.view = { zoom: 1, x: 0, y: 0 }; this.draw(); });
    const mode = this.part(".region");
    mode.addEventListener("click", () => mode.setAttribute("aria-pressed", mode.getAttribute("aria-pressed") !== "true"));
    const time = this.part(".time");
    time.addEventListener("input", () => this.choose(this.film()[Number(time.value)]));
    const play = this.part(".play");
    play.addEventListener("click", () => this.play(play.getAttribute("aria-pressed") !== "true"));
  }

  // Places: the map's own, those of the canvas in CSS pixels.
  fit() {
    const [x0, x1, y0, y1] = this.data.extent, box = this.canvas.getBoundingClientRect();
    const scale = Math.min((box.width - 28) / (x1 - x0 || 1), (box.height - 28) / (y1 - y0 || 1)) * this.view.zoom;
    return { box, scale, cx: (x0 + x1) / 2 + this.view.x, cy: (y0 + y1) / 2 + this.view.y };
  }
  place(row) {
    const { box, scale, cx, cy } = this.fit();
    return [box.width / 2 + (this.x[row] - cx) * scale, box.height / 2 - (this.y[row] - cy) * scale];
  }
  zoom(factor, at) {
    const before = this.fit(), [px, py] = at || [before.box.width / 2, before.box.height / 2];
    const mx = before.cx + (px - before.box.width / 2) / before.scale, my = before.cy - (py - before.box.height / 2) / before.scale;
    this.view.zoom = Math.min(200, Math.max(0.5, this.view.zoom * factor));
    const after = this.fit();
    this.view.x += mx - (after.cx + (px - after.box.width / 2) / after.scale);
    this.view.y += my - (after.cy - (py - after.box.height / 2) / after.scale);
    this.draw();
  }

  paint(index) {
    this.column = index;
    const { values, name, kinds } = this.columns[index];
    const { low, high, below, above } = span(values);
    const level = v => Math.min(9, Math.max(0, Math.floor((v - low) / (high - low || 1) * 10)));
    const few = kinds && kinds.length <= 10;
    const color = v => !Number.isFinite(v) ? NONE : few ? KINDS[v % 10] : VIRIDIS[level(v)];
    const groups = new Map();
    values.forEach((v, row) => { const c = color(v); if (!groups.has(c)) groups.set(c, []); groups.get(c).push(row); });
    this.groups = groups;
    const legend = this.part(".legend");
    legend.replaceChildren();
    if (few) kinds.forEach((kind, i) => legend.append(make("span", {}, Object.assign(make("i"), { style: `background:${KINDS[i % 10]}` }), kind)));
    else legend.append(make("span", {}, `${name}: ${below ? "≤ " : ""}${short(low)}`, Object.assign(make("span", { className: "bar" }), { style: `background:linear-gradient(90deg,${VIRIDIS.join()})` }), (above ? "≥ " : "") + short(high)));
    this.live.dataset.column = name;
    this.draw();
  }

  draw() {
    const { box, scale, cx, cy } = this.fit(), ratio = window.devicePixelRatio || 1;
    if (!box.width || !this.groups) return;
    this.canvas.width = Math.round(box.width * ratio); this.canvas.height = Math.round(box.height * ratio);
    const c = this.canvas.getContext("2d");
    c.scale(ratio, ratio);
    const r = Math.min(4, Math.max(0.8, 90 / Math.sqrt(this.x.length)) * Math.sqrt(this.view.zoom));
    const at = row => [box.width / 2 + (this.x[row] - cx) * scale, box.height / 2 - (this.y[row] - cy) * scale];
    const dots = (rows, radius, color) => {
      c.fillStyle = color; c.beginPath();
      for (const row of rows) {
        const [x, y] = at(row);
        if (x < -9 || y < -9 || x > box.width + 9 || y > box.height + 9) continue;
        c.moveTo(x + radius, y); c.arc(x, y, radius, 0, 6.2832);
      }
      c.fill();
    };
    // Outside a selected region colours fade.
    const inside = this.selected && new Set(this.selected);
    c.globalAlpha = inside ? 0.12 : 1;
    for (const [color, rows] of this.groups) dots(rows, r, color);
    c.globalAlpha = 1;
    if (inside) for (const [color, rows] of this.groups) dots(rows.filter(row => inside.has(row)), r + 0.8, color);
    if (this.chosen >= 0) {
      const path = this.film();
      c.strokeStyle = "#111"; c.lineWidth = 1.2; c.beginPath();
      path.forEach((row, i) => { const [x, y] = at(row); i ? c.lineTo(x, y) : c.moveTo(x, y); });
      c.stroke();
      dots(this.neighbours(this.chosen).map(n => n[0]), r + 2.5, "#0072b2");
      dots([this.chosen], r + 4, MARK);
    }
    if (this.region) {
      const [a, b] = this.region;
      c.strokeStyle = MARK; c.lineWidth = 1.5; c.fillStyle = "rgba(213,94,0,.12)";
      c.fillRect(a[0], a[1], b[0] - a[0], b[1] - a[1]); c.strokeRect(a[0], a[1], b[0] - a[0], b[1] - a[1]);
    }
  }

  // What is under the pointer: the nearest row that has a frame.
  under([px, py], reach = 24) {
    let best = -1, least = reach * reach;
    const { box, scale, cx, cy } = this.fit();
    for (const row of this.alive) {
      const dx = box.width / 2 + (this.x[row] - cx) * scale - px, dy = box.height / 2 - (this.y[row] - cy) * scale - py;
      if (dx * dx + dy * dy < least) { least = dx * dx + dy * dy; best = row; }
    }
    return best;
  }

  mouse() {
    const canvas = this.canvas, at = e => { const b = canvas.getBoundingClientRect(); return [e.clientX - b.left, e.clientY - b.top]; };
    let from = null, moved = false;
    canvas.addEventListener("pointerdown", e => {
      canvas.setPointerCapture(e.pointerId);
      this.pointers.set(e.pointerId, at(e));
      from = at(e); moved = false;
      const choosing = e.shiftKey || this.part(".region").getAttribute("aria-pressed") === "true";
      this.region = choosing && this.pointers.size === 1 ? [from, from] : null;
    });
    canvas.addEventListener("pointermove", e => {
      if (!this.pointers.has(e.pointerId)) return;
      const before = this.pointers.get(e.pointerId), now = at(e);
      this.pointers.set(e.pointerId, now);
      if (Math.hypot(now[0] - from[0], now[1] - from[1]) > 5) moved = true;
      if (this.pointers.size === 2) {
        const [a, b] = [...this.pointers.values()], other = a === now ? b : a;
        const spread = p => Math.hypot(p[0] - other[0], p[1] - other[1]);
        return this.zoom(spread(now) / (spread(before) || 1), [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2]);
      }
      if (this.region) this.region[1] = now;
      else if (moved) {
        const { scale } = this.fit();
        this.view.x -= (now[0] - before[0]) / scale; this.view.y += (now[1] - before[1]) / scale;
      }
      this.draw();
    });
    const end = e => {
      if (!this.pointers.delete(e.pointerId)) return;
      if (this.region && moved) this.select(this.region);
      else if (!moved) { const row = this.under(at(e)); if (row >= 0) this.choose(row, true); }
      this.region = null;
      this.draw();
    };
    canvas.addEventListener("pointerup", end);
    canvas.addEventListener("pointercancel", end);
    canvas.addEventListener("wheel", e => { e.preventDefault(); this.zoom(Math.exp(-e.deltaY / 400), at(e)); }, { passive: false });
  }

  keys() {
    this.canvas.addEventListener("keydown", e => {
      const film = this.film(), here = film.indexOf(this.chosen);
      const step = { ArrowRight: 1, ArrowLeft: -1 }[e.key], jump = { ArrowDown: 1, ArrowUp: -1 }[e.key];
      if (step) this.choose(this.chosen < 0 ? this.alive[0] : film[Math.min(film.length - 1, Math.max(0, here + step))], true);
      else if (jump) {
        const episodes = [...new Set([...this.alive].map(row => this.episode[row]))];
        const now = Math.max(0, episodes.indexOf(this.episode[this.chosen] ?? episodes[0]));
        const next = episodes[(now + (this.chosen < 0 ? 0 : jump) + episodes.length) % episodes.length];
        this.choose([...this.alive].find(row => this.episode[row] === next), true);
      } else if (e.key === "+" || e.key === "=") this.zoom(1.6);
      else if (e.key === "-") this.zoom(1 / 1.6);
      else if (e.key === "0") { this.view = { zoom: 1, x: 0, y: 0 }; this.draw(); }
      else if (e.key === "Escape") { this.selected = null; this.part(".chosen").replaceChildren(); this.draw(); }
      else return;
      e.preventDefault();
    });
  }

  // The rows of the chosen row's episode that have frames, in order of time.
  film() {
    if (this.chosen < 0) return [];
    const episode = this.episode[this.chosen];
    return [...this.alive].filter(row => this.episode[row] === episode).sort((a, b) => this.step[a] - this.step[b]);
  }
  neighbours(row) {
    const at = this.liveAt.get(row), k = this.data.k;
    return at === undefined ? [] : [...this.near.slice(at * k, at * k + k)].map((near, i) => [near, this.distance[at * k + i]]);
  }
  play(on) {
    this.part(".play").setAttribute("aria-pressed", on);
    clearInterval(this.timer);
    if (!on) return;
    if (this.chosen < 0) this.choose(this.alive[0]);
    this.timer = setInterval(() => {
      const film = this.film(), here = film.indexOf(this.chosen);
      this.choose(film[(here + 1) % film.length]);
    }, 90);
  }

  frame(row) {
    const { data } = this, index = this.frameOf.get(row);
    const canvas = make("canvas", { width: data.width, height: data.height });
    if (index === undefined) return make("span", { textContent: "no frame" });
    canvas.dataset.row = row;
    const perSheet = data.sheet * data.sheet, sheet = Math.floor(index / perSheet), within = index % perSheet;
    this.sheet(sheet).then(image => canvas.getContext("2d").drawImage(image, (within % data.sheet) * data.width, Math.floor(within / data.sheet) * data.height, data.width, data.height, 0, 0, data.width, data.height));
    return canvas;
  }
  sheet(number) {
    this.sheets[number] ??= (async () => {
      const image = new Image();
      image.src = "data:image/jpeg;base64," + document.querySelector(`script[data-sheet="${this.live.id}-${number}"]`).textContent;
      await image.decode();
      return image;
    })();
    return this.sheets[number];
  }

  describe(row) {
    const shown = this.columns.filter(c => !["episode", "step"].includes(c.name)).slice(0, 6);
    const text = c => `${c.name} ${c.kinds ? c.kinds[c.values[row]] ?? "–" : short(c.values[row])}`;
    return `episode ${this.episode[row]}, step ${this.step[row]}` + shown.map(c => ", " + text(c)).join("");
  }
  choose(row, linked) {
    if (row === undefined || row < 0) return;
    this.chosen = row;
    this.live.dataset.row = row;
    const film = this.film(), time = this.part(".time");
    time.max = film.length - 1; time.value = film.indexOf(row);
    const said = `episode ${this.episode[row]}, step ${this.step[row]}`;
    time.setAttribute("aria-valuetext", said);
    this.part("output").textContent = said;
    const near = this.neighbours(row).map(([n, d]) => this.button(n, `${this.episode[n]}:${this.step[n]} at ${short(d)}`));
    const strip = make("div", { className: "strip" }, ...near);
    const query = make("figure", { className: "query" }, this.frame(row));
    this.part(".card").replaceChildren(make("p", { textContent: this.describe(row) }), query, make("p", { className: "help", textContent: near.length ? "its nearest rows from other episodes (episode:step at standardized distance):" : "" }), strip);
    this.draw();
    // The same row of the other runs' maps.
    if (linked) maps.filter(m => m !== this).forEach(m => { const same = m.rowOf.get(this.episode[row] + ":" + this.step[row]); if (same !== undefined) m.choose(same); });
  }
  button(row, caption) {
    const button = make("button", { type: "button", title: this.describe(row) }, this.frame(row), caption);
    button.addEventListener("click", () => this.liveAt.has(row) ? this.choose(row, true) : this.choose(this.closest(row), true));
    return button;
  }
  // The row with neighbours of its own that lies closest in time.
  closest(row) {
    const same = [...this.alive].filter(r => this.episode[r] === this.episode[row]);
    return same.sort((a, b) => Math.abs(this.step[a] - this.step[row]) - Math.abs(this.step[b] - this.step[row]))[0];
  }

  select([a, b]) {
    const inside = row => { const [x, y] = this.place(row); return x >= Math.min(a[0], b[0]) && x <= Math.max(a[0], b[0]) && y >= Math.min(a[1], b[1]) && y <= Math.max(a[1], b[1]); };
    this.selected = [...this.x.keys()].filter(inside);
    const framed = this.selected.filter(row => this.frameOf.has(row));
    const every = Math.max(1, Math.ceil(framed.length / MOST_CHOSEN));
    const shown = framed.filter((_, i) => i % every === 0);
    const { name, values, kinds } = this.columns[this.column];
    const known = this.selected.map(row => values[row]).filter(Number.isFinite);
    const counts = new Map();
    if (kinds) known.forEach(v => counts.set(kinds[v], (counts.get(kinds[v]) || 0) + 1));
    const mean = known.reduce((sum, v) => sum + v, 0) / known.length;
    const most = [...counts].sort((p, q) => q[1] - p[1]).slice(0, 5).map(([kind, n]) => `${kind}: ${n}`).join(", ");
    const summary = `${this.selected.length} rows in the region` + (known.length ? kinds ? `; ${name} – ${most}` : `; ${name} ${short(mean)} on average, ${short(Math.min(...known))} to ${short(Math.max(...known))}` : "") + (shown.length < framed.length ? `; ${shown.length} of ${framed.length} frames` : "");
    this.live.dataset.selected = this.selected.length;
    const strip = make("div", { className: "strip" }, ...shown.map(row => this.button(row, `${this.episode[row]}:${this.step[row]}`)));
    this.part(".chosen").replaceChildren(make("p", { textContent: summary }), strip);
    this.draw();
  }
}

document.querySelectorAll(".live").forEach(live => maps.push(new LiveMap(live)));
