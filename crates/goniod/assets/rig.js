// The rig to scale, in the plane of the arms: angles from the normal, positive to the right.

import { element } from "./plot.js";

const ARM = 92, SCALE = 100;

const at = (deg, radius) => {
  const a = deg * Math.PI / 180;
  return [radius * Math.sin(a), -radius * Math.cos(a)];
};
const point = (deg, radius) => at(deg, radius).map((v) => v.toFixed(2)).join(" ");
const sector = (from, to, radius) => to <= from ? "" :
  `M0 0L${point(from, radius)}A${radius} ${radius} 0 0 1 ${point(to, radius)}Z`;
const clamp = (deg) => Math.min(Math.max(deg, -90), 90);

export class Drawing {
  constructor(svg) {
    this.svg = svg;
    const scale = element("g");
    scale.append(element("path", { class: "scale", d: `M${point(-90, SCALE)}A${SCALE} ${SCALE} 0 0 1 ${point(90, SCALE)}` }));
    for (let deg = -90; deg <= 90; deg += 10) {
      const long = deg % 30 === 0;
      const [[x1, y1], [x2, y2]] = [at(deg, SCALE), at(deg, SCALE + (long ? 5 : 3))];
      scale.append(element("line", { class: "scale", x1, y1, x2, y2 }));
      if (!long) continue;
      const [x, y] = at(deg, SCALE + 14);
      scale.append(element("text", { x, y: y + 2 }, `${deg}°`));
    }
    this.keepOut = element("path", { class: "keep-out" });
    this.limits = element("g");
    this.arms = { light: this.arm("light"), sensor: this.arm("sensor") };
    svg.append(this.keepOut, this.limits, scale,
      element("line", { class: "bench", x1: -100, x2: 100, y1: 3, y2: 3 }),
      element("rect", { class: "specimen", x: -14, y: 0, width: 28, height: 3 }),
      this.arms.sensor, this.arms.light);
  }

  arm(name) {
    const head = name === "light"
      ? [element("line", { class: "beam", x1: 0, y1: -ARM + 8, x2: 0, y2: -2 }), element("circle", { class: "head", cx: 0, cy: -ARM, r: 6.5 })]
      : [element("rect", { class: "head", x: -6, y: -ARM - 5, width: 12, height: 11, rx: 1.5 })];
    return element("g", { class: `arm ${name}` }, element("line", { x1: 0, y1: -ARM, x2: 0, y2: -ARM * 0.62 }), ...head);
  }

  // Where the arms may be: { light_deg: [min, max], sensor_deg: [min, max], separation_deg, can_pass }.
  envelope(envelope) {
    this.bounds = envelope;
    this.limits.replaceChildren(...["light", "sensor"].flatMap((arm, i) => envelope[`${arm}_deg`].map((deg) => {
      const [[x1, y1], [x2, y2]] = [at(deg, SCALE - 4 - 8 * i), at(deg, SCALE + 4 - 8 * i)];
      return element("line", { class: "limit", x1, y1, x2, y2 });
    })));
  }

  // Shades where the light may not be: beyond its limits, near the sensor, and past it where the arms collide.
  show({ light_deg: light, sensor_deg: sensor, lamp }) {
    const known = Number.isFinite(light) && Number.isFinite(sensor);
    for (const [arm, deg] of [["light", light], ["sensor", sensor]]) {
      this.arms[arm].style.display = known ? "" : "none";
      this.arms[arm].style.transform = `rotate(${deg}deg)`;
    }
    this.svg.classList.toggle("lit", Boolean(lamp));
    this.svg.querySelector("title").textContent = known
      ? `Light at ${light.toFixed(1)}°, sensor at ${sensor.toFixed(1)}°, lamp ${lamp ? "on" : "off"}; shaded is where the light may not go`
      : "Where the arms stand is not known yet";
    if (!this.bounds || !known) return;
    const { light_deg: [min, max], separation_deg: gap, can_pass: pass } = this.bounds;
    let [from, to] = [sensor - gap, sensor + gap];
    if (!pass) light < sensor ? to = 90 : from = -90;
    const parts = [[-90, min], [max, 90], [clamp(from), clamp(to)]].sort((a, b) => a[0] - b[0]);
    // One outline: shading must not be darker where two reasons meet.
    const joined = [];
    for (const [a, b] of parts) {
      const last = joined.at(-1);
      if (last && a <= last[1]) last[1] = Math.max(last[1], b); else joined.push([a, b]);
    }
    this.keepOut.setAttribute("d", joined.map(([a, b]) => sector(a, b, SCALE)).join(""));
  }
}
