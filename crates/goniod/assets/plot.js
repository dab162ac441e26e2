// A scatter plot that fills in: colour channels over one quantity, the vertical axis logarithmic.

const NS = "http://www.w3.org/2000/svg";
// In pixels of the page, so that labels stay as large as other text; the width is that of the page's column.
const HEIGHT = 340, LEFT = 62, TOP = 14, RIGHT = 14, BOTTOM = 46, LABEL = 42;
const CHANNELS = ["r", "g", "b"];
const DECADES = 6;

export const element = (name, attributes = {}, ...children) => {
  const node = document.createElementNS(NS, name);
  for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
  node.append(...children);
  return node;
};

const short = (value) => {
  if (value === 0) return "0";
  const size = Math.abs(value);
  return size >= 1e-3 && size < 1e4 ? String(Number(value.toPrecision(3))) : value.toExponential(1).replace(".0e", "e");
};

// An axis: ends, place of a value (0 … 1), labelled values.
const axis = (values, { log, ends }) => {
  let [low, high] = ends ?? [Math.min(...values), Math.max(...values)];
  if (log) {
    if (!Number.isFinite(low)) [low, high] = [0.1, 1];
    high *= 1.25;
    low = Math.min(Math.max(low / 1.25, high / 10 ** DECADES), high / 10);
  }
  const scale = log ? Math.log10 : (v) => v;
  const [from, to] = [scale(low), scale(high)];
  const ticks = [];
  if (log) {
    const steps = high / low > 300 ? [1] : [1, 2, 5];
    for (let decade = Math.floor(from); decade <= Math.ceil(to); decade++) {
      for (const step of steps) ticks.push(step * 10 ** decade);
    }
  } else {
    for (let tick = low; tick <= high; tick += 15) ticks.push(tick);
  }
  return {
    place: (v) => (scale(v) - from) / (to - from),
    ticks: ticks.filter((t) => t >= low * 0.9999 && t <= high * 1.0001),
  };
};

export class Plot {
  // `x`: { label, log, ends, unit }; `name` is what a reader of the screen hears.
  constructor(host, { name, x }) {
    this.x = x;
    this.points = [];
    this.marked = -1;
    this.host = host;
    host.className = "plot";
    host.tabIndex = 0;
    host.setAttribute("role", "application");
    host.setAttribute("aria-roledescription", "plot");
    host.setAttribute("aria-label", `${name}. Arrow keys go from reading to reading.`);
    this.output = document.createElement("output");
    this.width = 640;
    this.svg = element("svg", { "aria-hidden": "true" });
    // Of one height whatever the width, and drawn at once: nobody shall see it out of scale.
    this.svg.style.height = `${HEIGHT}px`;
    new ResizeObserver(() => {
      // One that is hidden has no width.
      if (!host.clientWidth) return;
      this.width = Math.max(host.clientWidth, 240);
      this.draw();
    }).observe(host);
    host.append(this.svg, this.output);
    host.addEventListener("pointermove", (event) => this.mark(this.nearest(event)));
    host.addEventListener("pointerleave", () => this.mark(-1));
    host.addEventListener("blur", () => this.mark(-1));
    host.addEventListener("keydown", (event) => {
      const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
      if (!step || !this.points.length) return;
      event.preventDefault();
      this.mark(Math.min(Math.max(this.marked + step, 0), this.points.length - 1));
    });
    this.draw();
  }

  // Points are { x, ring, rgb, text }; drawing adds where they are, `at`.
  show(points) {
    this.points = points.map((point) => ({ ...point, at: [] })).sort((a, b) => a.x - b.x);
    this.marked = -1;
    this.later();
  }

  add(given) {
    const point = { ...given, at: [] };
    const at = this.points.findIndex((other) => other.x > point.x);
    this.points.splice(at < 0 ? this.points.length : at, 0, point);
    if (this.marked >= 0 && at >= 0 && at <= this.marked) this.marked += 1;
    this.later();
  }

  // Readings come faster than anybody looks: ten drawings a second are enough.
  later() {
    this.due ??= setTimeout(() => { this.due = undefined; this.draw(); }, 100);
  }

  nearest(event) {
    if (!this.points.length) return -1;
    const box = this.svg.getBoundingClientRect();
    const [x, y] = [(event.clientX - box.left) / box.width * this.width, (event.clientY - box.top) / box.height * HEIGHT];
    const far = (point) => Math.min(...point.at.map(([px, py]) => Math.hypot(px - x, (py - y) / 3)), Infinity);
    let [best, least] = [-1, 60];
    this.points.forEach((point, i) => { const d = far(point); if (d < least) [best, least] = [i, d]; });
    return best;
  }

  mark(index) {
    this.marked = index;
    this.cursor?.remove();
    const point = this.points[index];
    this.output.textContent = point
      ? `${this.x.label} ${short(point.x)}${this.x.unit ?? ""}${point.ring ? " outwards" : ""}: ` +
        `red ${short(point.rgb[0])}, green ${short(point.rgb[1])}, blue ${short(point.rgb[2])} sr⁻¹${point.text ? `, ${point.text}` : ""}`
      : "";
    if (!point?.at.length) return;
    this.cursor = element("g", {},
      element("line", { class: "cursor", x1: point.at[0][0], x2: point.at[0][0], y1: TOP, y2: HEIGHT - BOTTOM }),
      ...point.at.map(([cx, cy]) => element("circle", { class: "marked", cx, cy, r: 6 })));
    this.svg.append(this.cursor);
  }

  draw() {
    const width = this.width;
    this.svg.setAttribute("viewBox", `0 0 ${width} ${HEIGHT}`);
    const positive = this.points.flatMap((point) => point.rgb.filter((v) => v > 0));
    const xs = this.points.map((point) => point.x).filter((v) => !this.x.log || v > 0);
    const [x, y] = [axis(xs, this.x), axis(positive, { log: true })];
    const px = (v) => LEFT + x.place(v) * (width - LEFT - RIGHT);
    const py = (v) => HEIGHT - BOTTOM - y.place(v) * (HEIGHT - TOP - BOTTOM);
    const parts = [];
    for (const tick of y.ticks) {
      parts.push(element("line", { class: "grid", x1: LEFT, x2: width - RIGHT, y1: py(tick), y2: py(tick) }),
        element("text", { x: LEFT - 6, y: py(tick) + 4, "text-anchor": "end" }, short(tick)));
    }
    let labelled = -Infinity;
    for (const tick of x.ticks) {
      parts.push(element("line", { class: "grid", x1: px(tick), x2: px(tick), y1: TOP, y2: HEIGHT - BOTTOM }));
      // Labels must not run into each other where there is little room.
      if (px(tick) - labelled < LABEL) continue;
      labelled = px(tick);
      parts.push(element("text", { x: labelled, y: HEIGHT - BOTTOM + 17, "text-anchor": "middle" }, short(tick)));
    }
    const middle = (TOP + HEIGHT - BOTTOM) / 2;
    parts.push(
      element("text", { x: (LEFT + width - RIGHT) / 2, y: HEIGHT - 8, "text-anchor": "middle" }, this.x.label + (this.x.unit ? ` in ${this.x.unit}` : "")),
      element("text", { x: 14, y: middle, "text-anchor": "middle", transform: `rotate(-90 14 ${middle})` }, "reflectance in sr⁻¹"));
    for (const point of this.points) {
      point.at = [];
      if (this.x.log && !(point.x > 0)) continue;
      point.rgb.forEach((value, channel) => {
        const [cx, cy] = [px(point.x), py(value)];
        if (!(value > 0) || cy > HEIGHT - BOTTOM + 1) return;
        point.at.push([cx, cy]);
        parts.push(element("circle", { class: CHANNELS[channel] + (point.ring ? " ring" : ""), cx: cx.toFixed(1), cy: cy.toFixed(1), r: 3 }));
      });
    }
    if (!this.points.length) parts.push(element("text", { class: "empty", x: (LEFT + width - RIGHT) / 2, y: middle }, "no readings yet"));
    this.svg.replaceChildren(...parts);
    this.mark(this.marked);
  }
}
