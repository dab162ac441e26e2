// The technician's page: shows what the daemon tells, and asks it for what the technician wants. It decides nothing.

import { Plot } from "./plot.js";
import { Drawing } from "./rig.js";

// Below wherever this page is: a proxy may have put it below a path of its own.
const API = "api/v1";
const LOGGED = 60;
const $ = (id) => document.getElementById(id);

const WORDS = {
  idle: "idle", identifying: "asking the devices", engaging: "engaging", warming_up: "lamp warms up", running: "running",
  paused: "paused", suspended: "holding by itself", shutting_down: "coming to rest", reporting: "writing the report", moving: "moving",
  queued: "queued", awaiting_specimen: "awaiting specimen", stopping: "stopping", interrupted: "interrupted",
  done: "done", failed: "failed", cancelled: "cancelled",
};
const MOODS = { running: "good", reporting: "good", warming_up: "good", engaging: "good", identifying: "good", done: "good",
  paused: "look", awaiting_specimen: "look", stopping: "look", interrupted: "look", failed: "bad" };
// What is worth saying of a run's result; its report says why.
const VERDICTS = { look: "look at its checks", bad: "not usable" };
const OVER = ["done", "failed", "cancelled"];

const drawing = new Drawing($("drawing"));
const plots = {
  plane: new Plot($("plot-g"), { name: "G, reflectance over d p", x: { label: "d_p", log: true } }),
  arc: new Plot($("plot-f"), { name: "F, reflectance over theta r", x: { label: "θ_r", unit: "°", ends: [0, 90] } }),
};
const jobs = new Map();
let rig, runs = [], role, stream, shown, seen = new Set();
// Seconds of ours for one of the rig's: a simulated rig's pass faster.
let pace;

// Asking.

async function ask(method, path, body) {
  const headers = {};
  if (typeof body === "string") headers["Content-Type"] = body.trimStart().startsWith("{") ? "application/json" : "application/toml";
  else if (body) headers["Content-Type"] = "application/json";
  const response = await fetch(API + path, { method, headers, body: typeof body === "object" ? JSON.stringify(body) : body, priority: "high" });
  if (response.status === 401) signIn();
  if (!response.ok) {
    const problem = await response.json().catch(() => ({}));
    throw new Error(problem.detail ?? `${response.status} ${response.statusText}`);
  }
  return response.status === 204 ? undefined : response.json();
}

// Asks for something and says so where that fails; whether it did not.
async function act(what, method, path, body) {
  try {
    const answer = await ask(method, path, body);
    notice();
    return answer ?? true;
  } catch (error) {
    notice(`${what}: ${error.message}`);
    return undefined;
  }
}

function notice(text) {
  $("notice").hidden = !text;
  $("notice").textContent = text ?? "";
}

// Showing.

const node = (name, properties = {}, ...children) => {
  const made = Object.assign(document.createElement(name), properties);
  made.append(...children);
  return made;
};
const chip = (state) => node("span", { className: `chip ${MOODS[state] ?? ""}` }, WORDS[state] ?? state);
const verdict = (run) => node("span", { className: `chip ${run.verdict}` }, VERDICTS[run.verdict]);
const degrees = (deg) => Number.isFinite(deg) ? `${deg.toFixed(2)}°` : "–";
const clock = (seconds) => {
  const s = Math.max(0, Math.round(seconds));
  return s < 60 ? `${s} s` : s < 3600 ? `${Math.floor(s / 60)} min ${String(s % 60).padStart(2, "0")} s`
    : `${Math.floor(s / 3600)} h ${String(Math.floor(s / 60) % 60).padStart(2, "0")} min`;
};
const when = (text) => {
  const time = new Date(text);
  const day = time.toDateString() === new Date().toDateString() ? {} : { day: "numeric", month: "short" };
  return time.toLocaleString([], { ...day, hour: "2-digit", minute: "2-digit" });
};
const title = (thing) => thing.specimen || thing.name;
const operates = () => role === "operate";

function showRig(view) {
  rig = view;
  const [light, sensor] = view.arms;
  drawing.envelope({ light_deg: [light.min_deg, light.max_deg], sensor_deg: [sensor.min_deg, sensor.max_deg],
    separation_deg: view.separation_deg, can_pass: view.can_pass });
  drawing.show({ light_deg: light.measured_deg ?? NaN, sensor_deg: sensor.measured_deg ?? NaN, lamp: view.lamp });
  $("light").textContent = degrees(light.measured_deg);
  $("sensor").textContent = degrees(sensor.measured_deg);
  $("lamp").textContent = view.lamp ? "on" : "off";
  $("monitor").textContent = view.lamp_monitor == null ? "–" : `${(100 * view.lamp_monitor).toFixed(1)} %`;
  $("temperature").textContent = view.temperature_c == null ? "–" : `${view.temperature_c} °C`;
  showNow();
  showFault();
  follow();
}

function showNow() {
  const job = jobs.get(rig.job);
  const state = rig.fault ? "fault" : job?.state === "paused" || job?.state === "stopping" ? job.state : rig.activity;
  if ($("state").dataset.state !== state) {
    $("state").dataset.state = state;
    $("state").textContent = WORDS[state] ?? state;
    $("state").className = `chip ${state === "fault" ? "bad" : MOODS[state] ?? ""}`;
  }
  const trouble = rig.connected || rig.activity !== "idle" ? undefined : rig.trouble;
  $("now-job").textContent = job ? title(job) : trouble ? `the rig does not answer: ${trouble}` : "nothing is running";
  $("bar-row").hidden = !rig.progress;
  if (rig.progress) {
    const { done, of, seconds_left: left, retries } = rig.progress;
    $("bar").max = of;
    $("bar").value = done;
    const taken = document.querySelector(`[data-run="${rig.run}"]`);
    if (taken) taken.textContent = `${done} of ${of}`;
    measurePace(left);
    $("left").textContent = `${done} of ${of} readings, ${clock(left * (pace?.factor ?? 1))} left` + (retries ? `, ${retries} ${retries === 1 ? "retry" : "retries"}` : "");
  } else {
    pace = undefined;
  }
  const under = job && !OVER.includes(job.state);
  $("pause").disabled = !operates() || !under || job.state !== "running";
  $("proceed").disabled = !operates() || !under || job.state !== "paused";
  // Never refused: pressed between two jobs it holds the next one.
  $("stop").disabled = !operates();
  for (const control of $("jog-form").elements) control.disabled = !operates() || Boolean(under) || Boolean(rig.fault);
}

function measurePace(left) {
  const now = performance.now() / 1000;
  if (!pace || pace.run !== rig.run || rig.activity === "paused") pace = { run: rig.run, since: now, first: left, factor: pace?.factor ?? 1 };
  const passed = pace.first - left;
  if (passed > 2) pace.factor = (now - pace.since) / passed;
}

function showFault() {
  const { fault } = rig;
  $("held").textContent = rig.queue_held && !fault ? `No job starts by itself: ${rig.queue_held}.` : "";
  // Two faults may say the same; whoever has seen only the first one must not acknowledge the second.
  if ($("fault").dataset.id === (fault?.id ?? "")) return;
  $("fault").dataset.id = fault?.id ?? "";
  $("fault").hidden = !fault;
  $("fault-code").textContent = fault ? `Fault: ${fault.code.replaceAll("_", " ")}.` : "";
  $("fault-text").textContent = fault?.text ?? "";
}

function showJobs() {
  const all = [...jobs.values()].sort((a, b) => a.place - b.place);
  // What never began is in no run and would be missed.
  const failed = all.filter((job) => job.state === "failed" && !job.run).slice(-3);
  const rows = all.filter((job) => !OVER.includes(job.state) || failed.includes(job)).map((job) => {
    const button = (action, text) => {
      const made = node("button", { type: "button" }, text);
      made.addEventListener("click", () => act(text, "POST", `/jobs/${job.id}/${action}`));
      made.disabled = !operates();
      made.dataset.action = action;
      return made;
    };
    const buttons = node("div", { className: "buttons" });
    if (job.state === "awaiting_specimen") buttons.append(button("ready", "Specimen is on the stage"));
    if (job.state === "interrupted") buttons.append(button("resume", "Resume"));
    if (["queued", "awaiting_specimen", "interrupted"].includes(job.state)) buttons.append(button("cancel", "Cancel"));
    const why = job.why ? [node("div", { className: "why" }, job.why)] : [];
    return node("tr", {}, node("td", {}, title(job)), node("td", {}, chip(job.state), ...why),
      node("td", {}, when(job.submitted)), node("td", {}, ...buttons.children.length ? [buttons] : []));
  });
  replace($("jobs"), rows);
}

function showRuns() {
  replace($("run-list"), runs.map((run) => {
    const state = jobs.get(run.job)?.state ?? "–";
    const judged = VERDICTS[run.verdict] ? [" ", verdict(run)] : [];
    const report = run.reported ? node("a", { href: `#run/${run.id}` }, "open",
      node("span", { className: "unseen" }, ` the report of ${title(run)}`)) : "not yet";
    const taken = node("td", {}, `${run.accepted} of ${run.planned}`);
    taken.dataset.run = run.id;
    return node("tr", {}, node("td", {}, title(run)), node("td", {}, chip(state), ...judged), node("td", {}, when(run.started)),
      taken, node("td", {}, report));
  }));
}

// Puts new rows in place; whoever had the focus keeps it.
function replace(body, rows) {
  const buttons = () => [...body.querySelectorAll("button, a")];
  const focused = buttons().indexOf(document.activeElement);
  body.replaceChildren(...rows);
  if (focused >= 0) buttons().at(Math.min(focused, buttons().length - 1))?.focus();
}

function log(at, text) {
  const time = node("time", { dateTime: at }, new Date(at).toLocaleTimeString());
  $("events").prepend(node("li", {}, time, text));
  while ($("events").children.length > LOGGED) $("events").lastChild.remove();
}

// Readings: those of the run under way, else of the last one.

async function follow() {
  const run = rig?.run ?? runs[0]?.id;
  if (run === shown) return;
  shown = run;
  seen = new Set();
  for (const plot of Object.values(plots)) plot.show([]);
  const known = runs.find((known) => known.id === run);
  $("plots-run").textContent = run ? `Of ${known ? title(known) : jobs.get(rig?.job)?.specimen || "the run under way"}.` : "None yet.";
  if (!run) return;
  const readings = await ask("GET", `/runs/${run}/readings`).catch(() => []);
  if (run === shown) readings.forEach(plotReading);
}

function plotReading(reading) {
  const key = `${reading.step}/${reading.attempt}`;
  const plot = plots[reading.sweep.split(" ")[0]];
  if (!plot || !reading.accepted || !reading.f || seen.has(key)) return;
  seen.add(key);
  const text = [plot === plots.plane ? `θ_r ${reading.theta_r_deg.toFixed(1)}°` : "", ...reading.flags].filter(Boolean).join(", ");
  const arc = plot === plots.arc;
  plot.add({ x: arc ? reading.theta_r_deg : Math.abs(reading.deviation), ring: !arc && reading.deviation < 0, rgb: reading.f, text });
}

// What happens.

const HAPPENINGS = {
  job: ({ job, at }) => {
    const before = jobs.get(job.id)?.state;
    jobs.set(job.id, job);
    const why = job.why ?? (job.verdict === "bad" && job.state === "done" ? "measured, but not usable: its report says why" : "");
    if (before !== job.state) log(at, `${title(job)}: ${WORDS[job.state]}${why ? ` (${why})` : ""}`);
    showJobs();
    if (rig) showNow();
    if (job.run) loadRuns();
  },
  reading: ({ run, reading }) => { if (run === shown) plotReading(reading); },
  repeat: ({ step, difference_rel: difference, at }) =>
    log(at, `Step ${step} was measured again: it differs by ${(100 * difference).toFixed(2)} %.`),
  warning: ({ text, at }) => log(at, text),
  fault: ({ fault, at }) => log(at, `Fault: ${fault.text}`),
  acknowledged: ({ by, at }) => log(at, `The fault was acknowledged by ${by}.`),
  gap: () => load(),
};

function listen() {
  stream?.close();
  stream = new EventSource(`${API}/events`);
  stream.addEventListener("open", () => { link("connected", "good"); load(); });
  stream.addEventListener("error", () => {
    link("connection lost", "bad");
    // A refused stream is not tried again by itself.
    if (stream.readyState === EventSource.CLOSED) setTimeout(start, 2000);
  });
  stream.addEventListener("rig", ({ data }) => showRig(JSON.parse(data)));
  stream.addEventListener("message", ({ data }) => {
    const event = JSON.parse(data);
    HAPPENINGS[event.event]?.(event);
  });
}

function link(text, mood) {
  $("link").textContent = text;
  $("link").className = `chip ${mood}`;
}

async function load() {
  try {
    const all = await ask("GET", "/jobs");
    jobs.clear();
    for (const job of all) jobs.set(job.id, job);
    await loadRuns();
    shown = undefined;
    showRig(await ask("GET", "/rig"));
    showJobs();
    route();
  } catch (error) {
    notice(`Cannot load: ${error.message}`);
  }
}

let loading;
async function loadRuns() {
  // Of several changes at once, the last is enough.
  loading ??= ask("GET", "/runs").finally(() => { loading = undefined; });
  runs = await loading;
  showRuns();
}

// Views.

async function route() {
  const id = location.hash.match(/^#run\/([0-9A-Za-z]+)$/)?.[1];
  if (!role) return;
  $("desk").hidden = Boolean(id);
  $("report").hidden = !id;
  $("sign-in").hidden = true;
  if (!id) { $("report-frame").removeAttribute("src"); return; }
  if ($("report").dataset.run === id && $("report-frame").hasAttribute("src")) return;
  $("report").dataset.run = id;
  try {
    const run = await ask("GET", `/runs/${id}`);
    const at = `${API}/runs/${id}/files`;
    $("report-title").textContent = title(run);
    $("report-facts").textContent = `Run ${run.id}, begun ${when(run.started)}, ${run.accepted} of ${run.planned} readings.`
      + (run.verdict === "bad" ? " Measured, but not usable: the checks below say why." : "");
    $("report-frame").src = $("report-alone").href = `${at}/report.html`;
    const files = await ask("GET", `/runs/${id}/files`);
    $("files").replaceChildren(...files.map(({ name, bytes }) =>
      node("li", {}, node("a", { href: `${at}/${name}`, download: name }, name), ` ${size(bytes)}`)));
    $("report-title").focus();
  } catch (error) {
    notice(`This run cannot be shown: ${error.message}`);
  }
}

const size = (bytes) => bytes < 1e3 ? `${bytes} B` : bytes < 1e6 ? `${(bytes / 1e3).toFixed(0)} kB` : `${(bytes / 1e6).toFixed(1)} MB`;

function signIn() {
  stream?.close();
  role = undefined;
  link("signed out", "look");
  for (const id of ["desk", "report", "fault"]) $(id).hidden = true;
  $("sign-in").hidden = false;
  $("token").focus();
}

// A sign-in link carries its token behind #, where it is in no request. It must not stay in the address bar.
async function followLink() {
  const token = location.hash.match(/^#token=(.+)$/)?.[1];
  if (!token) return;
  history.replaceState(null, "", location.pathname + location.search);
  await act("Sign in", "POST", "/session", { token });
}

async function start() {
  try {
    await followLink();
    const session = await ask("GET", "/session");
    role = session.role ?? undefined;
    $("sign-out").hidden = !session.needs_token || !role;
    if (!role) return signIn();
    $("submit").hidden = !operates();
    listen();
    route();
  } catch {
    link("connection lost", "bad");
    setTimeout(start, 2000);
  }
}

// Hands.

async function estop() {
  try {
    await ask("POST", "/estop");
    notice();
  } catch (error) {
    notice(`THE EMERGENCY STOP WAS NOT CARRIED OUT (${error.message}). Use the switch at the rig.`);
  }
}

const press = (id, run) => $(id).addEventListener("click", run);
press("estop", estop);
// The fault that is on the screen, whatever came since: somebody has looked at the rig because of that one.
press("acknowledge", () => act("Acknowledge", "POST", "/acknowledge", { fault: $("fault").dataset.id }));
press("pause", () => act("Pause", "POST", "/pause"));
press("proceed", () => act("Go on", "POST", "/proceed"));
press("stop", () => act("Stop", "POST", "/stop"));
press("park", () => act("Park", "POST", "/park"));
press("sign-out", async () => { await act("Sign out", "DELETE", "/session"); signIn(); });

addEventListener("keydown", (event) => {
  if (event.key !== "Escape" || event.repeat || event.isComposing) return;
  event.preventDefault();
  estop();
}, { capture: true });

// A report that was clicked on would keep the keys to itself, that of the emergency stop among them.
addEventListener("blur", () => setTimeout(() => {
  if (document.activeElement === $("report-frame")) $("report-title").focus({ preventScroll: true });
}));

const submitted = (id, run) => $(id).addEventListener("submit", (event) => { event.preventDefault(); run(); });
submitted("jog-form", () => act("Move", "POST", "/jog", { arm: $("jog-arm").value, angle_deg: $("jog-angle").valueAsNumber }));
submitted("token-form", async () => {
  if (await act("Sign in", "POST", "/session", { token: $("token").value })) {
    $("token").value = "";
    start();
  }
});
submitted("job-form", async () => {
  const name = $("job-file").files[0]?.name ?? "from the page";
  await answer(() => ask("POST", `/jobs?name=${encodeURIComponent(name)}`, $("job-text").value), (job) => `Added: ${title(job)}.`);
});
press("plan", () => answer(() => ask("POST", "/plan", $("job-text").value), (plan) =>
  [`${plan.readings} readings in ${clock(plan.seconds)}: ${plan.sweeps.map(({ sweep, readings }) => `${sweep} ${readings}`).join(", ")}.`,
    ...plan.left_out.map(({ what, why, readings }) => `Left out: ${what}, ${readings} readings (${why}).`)].join("\n")));

async function answer(asking, words) {
  try {
    $("job-answer").textContent = words(await asking());
  } catch (error) {
    $("job-answer").textContent = error.message;
  }
}

$("job-file").addEventListener("change", async () => {
  const [file] = $("job-file").files;
  if (file) $("job-text").value = await file.text();
});
$("submit").addEventListener("toggle", async () => {
  if ($("submit").open && !$("job-text").value) $("job-text").value = await (await fetch("assets/quickstart.toml")).text();
});

// A browser opens six connections to one place at most; pages that nobody looks at must not hold one, or an
// emergency stop could wait for it.
document.addEventListener("visibilitychange", () => {
  if (document.hidden) stream?.close(); else if (role) listen();
});
addEventListener("hashchange", () => location.hash.startsWith("#token=") ? start() : route());
start();
