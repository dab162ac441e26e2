// The technician's page: shows what the daemon tells, and asks it for what the technician wants. It decides nothing.

import { OVER, now, title } from "./now.js";
import { Plot } from "./plot.js";
import { Drawing } from "./rig.js";

// Below wherever this page is: a proxy may have put it below a path of its own.
const API = "api/v1";
const LOGGED = 60;
// Runs of the history that are shown at first, and with each wish for earlier ones.
const LISTED = 20;
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
const MARKS = { fault: "#ef4a4a", wanted: "#f0a35a", running: "#73c98f" };
const FORWARD = { ready: "Specimen is on the stage", resume: "Resume", proceed: "Go on" };
// Between two looks at the rig of a page that nobody sees; a browser may make it longer.
const LOOK_MS = 5000;

const drawing = new Drawing($("drawing"));
const plots = {
  plane: new Plot($("plot-g"), { name: "G, reflectance over d p", x: { label: "d_p", log: true } }),
  arc: new Plot($("plot-f"), { name: "F, reflectance over theta r", x: { label: "θ_r", unit: "°", ends: [0, 90] } }),
};
const jobs = new Map();
// The latest run, and those of the history as far as they were asked for.
let latest, runs = [], next;
let rig, role, stream, shown, seen = new Set();
// Seconds of ours for one of the rig's: a simulated rig's pass faster.
let pace;

// Asking.

// A list, and the query of what follows on it.
async function page(path) {
  const response = await answered("GET", path);
  const following = response.headers.get("Link")?.match(/^<\?([^>]*)>; rel="next"/)?.[1];
  return { items: await response.json(), next: following };
}

async function ask(method, path, body) {
  const response = await answered(method, path, body);
  return response.status === 204 ? undefined : response.json();
}

async function answered(method, path, body) {
  const headers = {};
  if (typeof body === "string") headers["Content-Type"] = body.trimStart().startsWith("{") ? "application/json" : "application/toml";
  else if (body) headers["Content-Type"] = "application/json";
  const response = await fetch(API + path, { method, headers, body: typeof body === "object" ? JSON.stringify(body) : body, priority: "high" });
  if (response.status === 401) signIn();
  if (!response.ok) {
    const problem = await response.json().catch(() => ({}));
    throw new Error(problem.detail ?? `${response.status} ${response.statusText}`);
  }
  return response;
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

// Saves what is made when it is asked for. A refusal is told, not saved.
async function save(what, path) {
  notice(`${what} is being made and checked.`);
  try {
    const response = await answered("GET", path);
    const name = response.headers.get("Content-Disposition")?.match(/filename="([^"]+)"/)?.[1] ?? what;
    const url = URL.createObjectURL(await response.blob());
    node("a", { href: url, download: name }).click();
    setTimeout(() => URL.revokeObjectURL(url), 60_000);
    notice();
  } catch (error) {
    notice(`${what}: ${error.message}`);
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
const when = (text, exactly) => {
  const time = new Date(text);
  const day = time.toDateString() === new Date().toDateString() ? {} : { day: "numeric", month: "short" };
  return time.toLocaleString([], { ...day, hour: "2-digit", minute: "2-digit", ...exactly && { second: "2-digit" } });
};
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
  const said = now({ rig, jobs: [...jobs.values()], run: latest });
  // Read out only where it is news, not with every reading.
  const news = `${said.state}/${said.job?.id ?? said.run?.id ?? ""}`;
  if ($("sentence").textContent !== said.text) {
    $("sentence").setAttribute("aria-live", $("sentence").dataset.news === news ? "off" : "polite");
    $("sentence").dataset.news = news;
    $("sentence").textContent = said.text;
  }
  showWanted(said);
  showTab(said);
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
  $("proceed").hidden = said.action === "proceed";
  $("proceed").disabled = !operates() || !under || job.state !== "paused";
  // Never refused: pressed between two jobs it holds the next one.
  $("stop").disabled = !operates();
  for (const control of $("jog-form").elements) control.disabled = !operates() || Boolean(under) || Boolean(rig.fault);
}

// The button of what is wanted next. The same one stays, so that whoever has the focus on it keeps it.
function showWanted({ state, job, run, action }) {
  const key = [state, job?.id, run?.id, action, role].join("/");
  if ($("wanted").dataset.key === key) return;
  $("wanted").dataset.key = key;
  const made = [];
  if (action) {
    const forward = node("button", { type: "button", className: "primary", disabled: !operates() }, FORWARD[action]);
    const path = action === "proceed" ? "/proceed" : `/jobs/${job.id}/${action}`;
    forward.addEventListener("click", () => act(FORWARD[action], "POST", path));
    made.push(forward);
  }
  if (run) made.push(node("a", { className: "button primary", href: `#run/${run.id}` }, "Open its report"));
  if (["done", "idle"].includes(state) && operates()) {
    const add = node("button", { type: "button", className: run ? "" : "primary" }, "Add a job");
    add.addEventListener("click", () => { $("submit").open = true; $("submit").scrollIntoView(); $("job-text").focus(); });
    made.push(add);
  }
  $("wanted").replaceChildren(...made);
  // What has its button here has none there.
  showJobs();
}

// The tab says it too, for whoever looks elsewhere: its title, its icon, and a notification where that was asked for.
const ICON = (await (await fetch("assets/icon.svg")).text()).replace("</svg>", "");
function showTab({ mood, state, title: told, text }) {
  const words = told ? `${told} – goniod` : "goniod";
  if (document.title !== words) document.title = words;
  if (document.documentElement.dataset.mood !== (mood ?? "")) {
    document.documentElement.dataset.mood = mood ?? "";
    const mark = MARKS[mood] ? `<circle cx="24" cy="8" r="8" fill="${MARKS[mood]}"/>` : "";
    $("icon").href = `data:image/svg+xml,${encodeURIComponent(`${ICON}${mark}</svg>`)}`;
  }
  const news = ["fault", "wanted"].includes(mood) || state === "done";
  const before = notified;
  notified = news ? `${state} ${told}` : "";
  if (!news || before === undefined || before === notified || !document.hidden || !notifies()) return;
  new Notification(words, { body: text, tag: "goniod", icon: $("icon").href, silent: !$("sound").checked });
}
// What was told last; nothing of what is so already when the page is opened.
let notified;
const notifies = () => window.isSecureContext && "Notification" in window && Notification.permission === "granted";

function showNotify() {
  const able = window.isSecureContext && "Notification" in window;
  $("notify").hidden = !able || Notification.permission === "denied";
  $("notify-me").hidden = notifies();
  $("notify-sound").hidden = !notifies();
  $("notify-why").textContent = !able ? "Browsers show notifications only of pages on localhost or over https; the title of this tab and its icon say how the rig stands."
    : Notification.permission === "denied" ? "This browser was told to show no notifications of this page."
    : notifies() ? "While this tab is hidden, the browser notifies you of a fault, of a specimen that is wanted, and of the end of a run." : "";
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
  $("fault-remedy").textContent = fault?.remedy ? `What to do: ${fault.remedy}` : "";
}

function showJobs() {
  const all = [...jobs.values()].sort((a, b) => a.place - b.place);
  // What never began is in no run and would be missed.
  const failed = all.filter((job) => job.state === "failed" && !job.run).slice(-3);
  const rows = all.filter((job) => !OVER.includes(job.state) || failed.includes(job)).map((job) => {
    const name = (text) => [text, node("span", { className: "unseen" }, ` ${title(job)}`)];
    const button = (text, press) => {
      const made = node("button", { type: "button", disabled: !operates() }, ...name(text));
      made.addEventListener("click", press);
      return [made];
    };
    // What is wanted next has its button at the head of the page.
    const forward = job.state !== "interrupted" || rig?.fault || $("wanted").dataset.key?.includes(job.id) ? []
      : button("Resume", () => act("Resume", "POST", `/jobs/${job.id}/resume`));
    const over = !["queued", "awaiting_specimen", "interrupted"].includes(job.state) ? [] : button("Cancel …", () => cancel(job));
    const why = job.why ? [node("div", { className: "why" }, job.why)] : [];
    return node("tr", {}, node("td", {}, title(job)), node("td", {}, chip(job.state), ...why),
      node("td", {}, when(job.submitted)), node("td", {}, ...forward), node("td", { className: "give-up" }, ...over));
  });
  replace($("jobs"), rows);
}

// Asks before a job is given up: that cannot be taken back.
async function cancel(job) {
  const kept = job.run ? "What was measured is kept, but it cannot go on." : "It was not begun.";
  if (await confirmed(`Cancel “${title(job)}”?`, kept, "Cancel the job")) act("Cancel", "POST", `/jobs/${job.id}/cancel`);
}

function confirmed(question, text, yes) {
  const dialog = $("confirm");
  $("confirm-title").textContent = question;
  $("confirm-text").textContent = text;
  $("confirm-yes").textContent = yes;
  dialog.returnValue = "";
  dialog.showModal();
  return new Promise((answered) => dialog.addEventListener("close", () => answered(dialog.returnValue === "yes"), { once: true }));
}

function showRuns() {
  replace($("run-list"), runs.map((run) => {
    const judged = VERDICTS[run.verdict] ? [" ", verdict(run)] : [];
    const report = run.reported ? node("a", { href: `#run/${run.id}` }, "open",
      node("span", { className: "unseen" }, ` the report of ${title(run)}`)) : "not yet";
    const taken = node("td", {}, `${run.accepted} of ${run.planned}`);
    taken.dataset.run = run.id;
    const { specimen_id: number, material, tags, operator } = run.record;
    const more = [number, material, ...tags.map((tag) => `#${tag}`)].filter(Boolean).join(" · ");
    const about = more ? [node("div", { className: "why" }, more)] : [];
    return node("tr", {}, node("td", {}, title(run), ...about), node("td", {}, chip(run.state), ...judged), node("td", {}, when(run.started)),
      taken, node("td", {}, operator), node("td", {}, report));
  }));
  $("no-runs").textContent = asked() ? "No run is like that." : "No runs yet.";
  $("earlier").hidden = !next;
}

// Puts new rows in place; whoever had the focus keeps it.
function replace(body, rows) {
  const buttons = () => [...body.querySelectorAll("button, a")];
  const focused = buttons().indexOf(document.activeElement);
  body.replaceChildren(...rows);
  if (focused >= 0) buttons().at(Math.min(focused, buttons().length - 1))?.focus();
}

// Newest first. What comes by the list and by the stream is told once.
function log(at, text, id) {
  const lines = [...$("events").children];
  if (lines.some((line) => line.dataset.id === String(id))) return;
  const time = node("time", { dateTime: at }, when(at, true));
  const line = node("li", {}, time, text);
  line.dataset.id = id;
  const next = lines.find((other) => Number(other.dataset.id) < id);
  if (next) next.before(line); else $("events").append(line);
  while ($("events").children.length > LOGGED) $("events").lastChild.remove();
}

// The list as it was before this page was opened.
async function loadLog() {
  const states = new Map();
  for (const event of await ask("GET", "/log")) {
    if (event.event !== "job") { HAPPENINGS[event.event]?.(event); continue; }
    // Only what changed, as for whoever had watched.
    if (states.get(event.job.id) !== event.job.state) logJob(event);
    states.set(event.job.id, event.job.state);
  }
}

function logJob({ job, at, id }) {
  const why = job.why ?? (job.verdict === "bad" && job.state === "done" ? "measured, but not usable: its report says why" : "");
  log(at, `${title(job)}: ${WORDS[job.state]}${why ? ` (${why})` : ""}`, id);
}

// Readings: those of the run under way, else of the last one.

async function follow() {
  const run = rig?.run ?? latest?.id;
  if (run === shown) return;
  shown = run;
  seen = new Set();
  for (const plot of Object.values(plots)) plot.show([]);
  const known = [latest, ...runs].find((known) => known?.id === run);
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
  job: (event) => {
    const { job } = event;
    const before = jobs.get(job.id)?.state;
    jobs.set(job.id, job);
    if (before !== job.state) logJob(event);
    if (rig) showNow();
    showJobs();
    if (job.run) loadRuns();
  },
  reading: ({ run, reading }) => { if (run === shown) plotReading(reading); },
  repeat: ({ step, difference_rel: difference, at, id }) =>
    log(at, `Step ${step} was measured again: it differs by ${(100 * difference).toFixed(2)} %.`, id),
  warning: ({ text, at, id }) => log(at, text, id),
  fault: ({ fault, at, id }) => log(at, `Fault: ${fault.text}`, id),
  acknowledged: ({ by, at, id }) => log(at, `The fault was acknowledged by ${by}.`, id),
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
    const all = await ask("GET", "/jobs?limit=10");
    jobs.clear();
    for (const job of all) jobs.set(job.id, job);
    await loadRuns();
    await loadLog();
    shown = undefined;
    showRig(await ask("GET", "/rig"));
    showJobs();
    route();
  } catch (error) {
    notice(`Cannot load: ${error.message}`);
  }
}

// What the history is asked for, as a query.
function asked() {
  const said = [...new FormData($("search"))].filter(([, value]) => value);
  return new URLSearchParams(said).toString();
}

let loading, again = false;
async function loadRuns() {
  // Of several changes at once, the last is enough.
  if (loading) { again = true; return loading; }
  loading = (async () => {
    do {
      again = false;
      const query = asked();
      const [shown, newest] = [await page(`/runs?limit=${LISTED}&${query}`), query ? await ask("GET", "/runs?limit=1") : undefined];
      latest = (newest ?? shown.items)[0];
      // What was asked for beyond the first page stays, as long as it is an answer to the same.
      const last = shown.items.at(-1);
      const beyond = query === listed ? runs.filter((run) => last && run.place < last.place) : [];
      runs = [...shown.items, ...beyond];
      if (!beyond.length) next = shown.next;
      listed = query;
    } while (again);
  })().finally(() => { loading = undefined; });
  await loading;
  showRuns();
  if (rig) showNow();
}
// The query that the list answers.
let listed;

async function earlier() {
  if (!next) return;
  try {
    const more = await page(`/runs?${next}`);
    runs.push(...more.items);
    next = more.next;
    notice();
    showRuns();
  } catch (error) {
    notice(`Earlier runs: ${error.message}`);
  }
}

// A browser opens six connections to one place at most; a page that nobody sees must not hold one, or an emergency stop
// could wait for it. It looks now and then instead, since its title and its notifications are for whoever is elsewhere.
let looking;
async function lookAgain() {
  try {
    const [all, view] = [await ask("GET", "/jobs?limit=10"), await ask("GET", "/rig")];
    for (const job of all) jobs.set(job.id, job);
    await loadRuns();
    if (document.hidden) showRig(view);
  } catch {
    document.title = "No connection – goniod";
  }
  if (document.hidden && role) looking = setTimeout(lookAgain, LOOK_MS);
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
    showRecord(run);
    const files = await ask("GET", `/runs/${id}/files`);
    $("files").replaceChildren(...files.map(({ name, bytes, made }) =>
      node("li", {}, node("a", { href: `${at}/${name}`, download: "" }, name), ` ${size(bytes)}${made ? ", made when asked for" : ""}`)));
    const formats = await ask("GET", `/runs/${id}/exports`);
    $("exports").replaceChildren(...formats.map(({ format, about }) => {
      const path = `/runs/${id}/exports/${format}`;
      const link = node("a", { href: API + path, download: "" }, format);
      // An archive of all is sent as it is made, and may be large: it is the browser's to save.
      if (format !== "all") link.onclick = (event) => { event.preventDefault(); save(format, path); };
      return node("li", {}, link, `: ${about}`);
    }));
    $("report-title").focus();
  } catch (error) {
    notice(`This run cannot be shown: ${error.message}`);
  }
}

// What is said of the run whose report is shown.
function showRecord(run) {
  const { record } = run;
  const said = { ...record, specimen: run.specimen, tags: record.tags.join(", ") };
  for (const field of $("record-form").elements) {
    if (field.name) field.value = said[field.name];
    field.disabled = !operates();
  }
  $("record-edited").textContent = "This is description: what was measured, and the files, stay as they are."
    + (record.edited ? ` It was edited on ${when(record.edited)} by ${record.edited_by}.` : "");
  $("archive").textContent = run.archived ? "Take the run back into the history" : "Put the run away";
  $("archive").dataset.does = run.archived ? "unarchive" : "archive";
  for (const id of ["archive", "delete"]) $(id).disabled = !operates();
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

// Esc stops the rig, but where somebody types a text or answers a question: there it leaves that.
addEventListener("keydown", (event) => {
  if (event.key !== "Escape" || event.repeat || event.isComposing || $("confirm").open) return;
  event.preventDefault();
  const typed = document.activeElement?.closest("[data-esc]");
  if (!typed) return estop();
  const details = typed.closest("details") ?? typed.querySelector("details");
  if (details) details.open = false;
  (details?.querySelector("summary") ?? $("now")).focus();
}, { capture: true });

// The report's page scrolls with this one. It may run no script, so it is measured from here.
$("report-frame").addEventListener("load", () => {
  const inside = $("report-frame").contentDocument?.documentElement;
  if (!inside) return;
  const fit = () => { $("report-frame").style.height = `${inside.querySelector("body").scrollHeight + 8}px`; };
  fit();
  new ResizeObserver(fit).observe(inside.querySelector("main") ?? inside);
});

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
    ...plan.left_out.filter(({ readings }) => readings).map(({ what, why, readings }) => `Left out: ${what}, ${readings} readings (${why}).`)].join("\n")));
press("earlier", earlier);
let searching;
const search = () => { clearTimeout(searching); searching = setTimeout(() => loadRuns().catch((error) => notice(`Search: ${error.message}`)), 200); };
$("search").addEventListener("input", search);
$("search").addEventListener("reset", search);
submitted("search", search);
submitted("record-form", async () => {
  const edit = Object.fromEntries(new FormData($("record-form")));
  edit.tags = edit.tags.split(",").map((tag) => tag.trim()).filter(Boolean);
  const run = await act("The record", "PATCH", `/runs/${$("report").dataset.run}`, edit);
  if (!run) return;
  showRecord(run);
  $("report-title").textContent = title(run);
  loadRuns();
});
press("archive", async () => {
  const run = await act("Put away", "POST", `/runs/${$("report").dataset.run}/${$("archive").dataset.does}`);
  if (run) { showRecord(run); loadRuns(); }
});
press("delete", async () => {
  const yes = await confirmed(`Delete “${$("report-title").textContent}”?`, "Its readings and its files are deleted. This cannot be taken back.", "Delete the run");
  if (!yes || !await act("Delete", "DELETE", `/runs/${$("report").dataset.run}`)) return;
  location.hash = "";
  loadRuns();
});
press("notify-me", async () => { await Notification.requestPermission(); showNotify(); });
$("sound").checked = localStorage.getItem("sound") === "yes";
$("sound").addEventListener("change", () => localStorage.setItem("sound", $("sound").checked ? "yes" : "no"));

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

document.addEventListener("visibilitychange", () => {
  clearTimeout(looking);
  if (!role) return;
  if (document.hidden) { stream?.close(); lookAgain(); } else listen();
});
showNotify();
addEventListener("hashchange", () => location.hash.startsWith("#token=") ? start() : route());
start();
