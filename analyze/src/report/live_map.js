"use strict";
// Maps to hover over. Each .live element holds its data as JSON, its frames as sprite sheets, a canvas and a card.
const VIRIDIS = ["#440154", "#482878", "#3e4989", "#31688e", "#26828e", "#1f9e89", "#35b779", "#6ece58", "#b5de2b", "#fde725"];

function drawFrame(live, data, index, side, caption, className) {
  const figure = document.createElement("figure");
  figure.className = className;
  if (index !== null) {
    const canvas = document.createElement("canvas");
    canvas.width = side;
    canvas.height = Math.round(side * data.height / data.width);
    const sheets = live.querySelectorAll("img.sheet");
    const perSheet = data.sheet * data.sheet;
    const within = index % perSheet;
    const paint = () => canvas.getContext("2d").drawImage(
      sheets[Math.floor(index / perSheet)], (within % data.sheet) * data.width, Math.floor(within / data.sheet) * data.height,
      data.width, data.height, 0, 0, canvas.width, canvas.height);
    const sheet = sheets[Math.floor(index / perSheet)];
    if (sheet.complete) paint(); else sheet.addEventListener("load", paint);
    canvas.dataset.frame = index;
    figure.append(canvas);
  }
  const text = document.createElement("figcaption");
  text.textContent = caption;
  figure.append(text);
  return figure;
}

function show(live, state, index) {
  state.chosen = index;
  state.redraw();
  const [, , , text, frame, neighbours] = state.data.points[index];
  const card = live.querySelector(".card");
  const heading = document.createElement("p");
  heading.textContent = text;
  const row = document.createElement("div");
  row.append(...neighbours.map(([caption, at]) => drawFrame(live, state.data, at, 76, caption, "neighbour")));
  card.replaceChildren(heading, drawFrame(live, state.data, frame, 168, "this row", "query"), row);
  live.dataset.point = index;
}

function start(live) {
  const data = JSON.parse(live.querySelector("script").textContent);
  const canvas = live.querySelector("canvas.cloud");
  const context = canvas.getContext("2d");
  const all = data.background.concat(data.points);
  const xs = all.map(p => p[0]), ys = all.map(p => p[1]);
  const range = v => v.reduce(([a, b], x) => [Math.min(a, x), Math.max(b, x)], [Infinity, -Infinity]);
  const [x0, x1] = range(xs), [y0, y1] = range(ys);
  const scale = Math.min((canvas.width - 24) / (x1 - x0 || 1), (canvas.height - 24) / (y1 - y0 || 1));
  const place = p => [canvas.width / 2 + (p[0] - (x0 + x1) / 2) * scale, canvas.height / 2 - (p[1] - (y0 + y1) / 2) * scale];
  const state = { data, chosen: -1 };
  const dot = (p, radius, color) => {
    const [x, y] = place(p);
    context.beginPath();
    context.arc(x, y, radius, 0, 7);
    context.fillStyle = color;
    context.fill();
  };
  state.redraw = () => {
    context.clearRect(0, 0, canvas.width, canvas.height);
    data.background.forEach(p => dot(p, 1, "#d8d8d8"));
    data.points.forEach(p => dot(p, 2.6, VIRIDIS[Math.min(9, Math.floor(p[2] * 10))]));
    if (state.chosen >= 0) dot(data.points[state.chosen], 6, "#d55e00");
    context.fillStyle = "#666";
    context.fillText("colour: " + data.colorName + " (dark: low, yellow: high)", 6, canvas.height - 6);
  };
  const nearest = (x, y) => {
    let best = -1, distance = 14 * 14;
    data.points.forEach((p, i) => {
      const [px, py] = place(p);
      const d = (px - x) ** 2 + (py - y) ** 2;
      if (d < distance) { best = i; distance = d; }
    });
    return best;
  };
  canvas.addEventListener("mousemove", event => {
    const box = canvas.getBoundingClientRect();
    const index = nearest((event.clientX - box.left) * canvas.width / box.width, (event.clientY - box.top) * canvas.height / box.height);
    if (index >= 0 && index !== state.chosen) show(live, state, index);
  });
  canvas.addEventListener("keydown", event => {
    const step = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 }[event.key];
    if (!step) return;
    event.preventDefault();
    show(live, state, (state.chosen + step + data.points.length) % data.points.length);
  });
  live.place = index => place(data.points[index]);
  state.redraw();
}

document.querySelectorAll(".live").forEach(start);
