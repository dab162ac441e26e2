// Drives the page as a technician would, on a simulated rig in real time; looks at it wide and narrow, light and dark.
// Usage: node check.js GONIOD DIR

import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { mkdtempSync, readFileSync, rmSync, statSync, writeFileSync } from "node:fs";
import { createServer, request as forward } from "node:http";
import { createRequire } from "node:module";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { createInterface } from "node:readline";
import { chromium } from "playwright-core";

const [goniod, shots] = process.argv.slice(2);
const axe = readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");
// How long anything is waited for before it counts as missing: several times what the whole takes on a busy machine.
const LONG = 600_000;

const data = mkdtempSync(join(tmpdir(), "goniod-browser-"));
const rig = join(data, "rig.toml");
// Chromium draws on the same cores, and each byte to the simulated bus and back waits for one of them four times: for
// our thread, the simulator's and twice the kernel's, which carries bytes over a pseudo-terminal. So a reply may be as
// late as over the slowest adapter, a device may be silent for longer, and no watchdog takes that for a dead daemon.
writeFileSync(rig, '[bus]\nlatency_ms = 100\nsilence_ms = 5000\n[motion]\nwatchdog_ms = 0\n[sim]\nclock = "real"\n');
const daemon = spawn(goniod, ["--config", rig, "--data", join(data, "runs"), "--listen", "127.0.0.1:0"], { stdio: ["ignore", "pipe", "inherit"] });
const [origin] = await new Promise((resolve, reject) => {
  createInterface(daemon.stdout).once("line", (line) => resolve([line]));
  daemon.once("exit", (code) => reject(new Error(`goniod ended with ${code}`)));
});
const tokens = readFileSync(join(data, "runs", "tokens.toml"), "utf8");
const token = tokens.match(/^operate = "(.*)"$/m)[1];
// The page is used below a path of its own, behind a proxy that a laboratory may have in front of it.
const proxy = createServer((request, response) => {
  if (!request.url.startsWith("/rig/")) { response.writeHead(404).end(); return; }
  const passed = forward(`${origin}${request.url.slice("/rig".length)}`, { method: request.method, headers: request.headers }, (answer) => {
    response.writeHead(answer.statusCode, answer.headers);
    answer.pipe(response);
  });
  passed.on("error", () => response.destroy());
  response.on("close", () => passed.destroy());
  request.pipe(passed);
});
await new Promise((listening) => proxy.listen(0, "127.0.0.1", listening));
const address = `http://127.0.0.1:${proxy.address().port}/rig`;
const browser = await chromium.launch({ executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium", args: ["--no-sandbox"] });
const WIDE = { width: 1280, height: 900 };
const NARROW = { width: 390, height: 844 };
const complaints = [];

async function open(options, hash = "") {
  const context = await browser.newContext({ reducedMotion: "no-preference", ...options });
  const page = await context.newPage();
  page.setDefaultTimeout(LONG);
  page.on("console", (message) => { if (["error", "warning"].includes(message.type())) complaints.push(`console: ${message.text()} (${message.location().url})`); });
  page.on("pageerror", (error) => complaints.push(`page: ${error.stack}`));
  page.on("request", (request) => { if (!request.url().startsWith(address) && !request.url().startsWith("data:")) complaints.push(`fetched ${request.url()}`); });
  // As the link that goniod prints to a terminal.
  await page.goto(`${address}/#token=${token}`);
  await page.getByText("connected", { exact: true }).waitFor();
  assert.equal(page.url(), `${address}/`, "the token does not stay in the address bar");
  await page.evaluate((hash) => { location.hash = hash; }, hash);
  return page;
}

// What the page looks like in every size and colour, and whether anybody can read and operate it. Each is opened anew, as
// by somebody who comes by, and closed again: a page that nobody looks at draws all the same.
async function look(name) {
  const known = { g: await dots(main, "g"), f: await dots(main, "f") };
  for (const [size, viewport] of Object.entries({ wide: WIDE, narrow: NARROW })) {
    for (const colorScheme of ["light", "dark"]) {
      const page = await open({ viewport, colorScheme, isMobile: size === "narrow" }, new URL(main.url()).hash);
      await until("the arms", async () => (await angle(page, "light")) !== "–");
      for (const plot of ["g", "f"]) await until(`the readings in ${plot}`, async () => (await dots(page, plot)) >= known[plot]);
      await until("plots to scale", () => page.evaluate(() => [...document.querySelectorAll(".plot")].every((plot) =>
        !plot.clientWidth || plot.querySelector("svg").viewBox.baseVal.width === Math.max(plot.clientWidth, 240))));
      if (page.url().includes("#run/")) {
        await checks(page).waitFor();
        await page.frameLocator("#report-frame").locator("img").first().evaluate((img) => img.decode());
      }
      // Drawn once with all of that.
      await page.evaluate(() => new Promise((drawn) => requestAnimationFrame(() => requestAnimationFrame(drawn))));
      await page.screenshot({ path: join(shots, `${name}-${size}-${colorScheme}.png`), fullPage: true, animations: "disabled" });
      const wide = await page.evaluate(() => document.documentElement.scrollWidth - innerWidth);
      if (wide > 0) complaints.push(`${name} ${size}: ${wide} pixels too wide`);
      await page.evaluate(axe);
      const { violations } = await page.evaluate(() => axe.run(document, { iframes: false }));
      for (const { id, help, nodes } of violations) {
        complaints.push(`axe: ${name} ${size} ${colorScheme}: ${id}: ${help}: ${nodes.map((n) => `${n.target} ${n.failureSummary}`).join("; ")}`);
      }
      await page.context().close();
    }
  }
  await main.bringToFront();
}

const dots = (page, plot) => page.locator(`#plot-${plot} circle:not(.marked)`).count();
const angle = async (page, arm) => page.locator(`#${arm}`).textContent();
const checks = (page) => page.frameLocator("#report-frame").getByRole("heading", { name: "Checks" });
const view = async () => (await fetch(`${origin}/api/v1/rig`, { headers: { Authorization: `Bearer ${token}` } })).json();
const until = async (what, holds) => {
  const end = Date.now() + LONG;
  while (!(await holds())) {
    assert(Date.now() < end, `waited in vain for: ${what}`);
    await main.waitForTimeout(100);
  }
};

let main;
try {
  console.log("signs in: not with a wrong token, and not without one");
  for (const hash of ["", `#token=${"0".repeat(64)}`]) {
    const page = await (await browser.newContext({ viewport: WIDE })).newPage();
    page.setDefaultTimeout(LONG);
    await page.goto(`${address}/${hash}`);
    await page.getByRole("heading", { name: "Sign in" }).waitFor();
    assert.equal(page.url(), `${address}/`, "no token stays in the address bar");
    await page.screenshot({ path: join(shots, `sign-in${hash ? "-refused" : ""}.png`) });
    await page.context().close();
  }
  main = await open({ viewport: WIDE, colorScheme: "light" });
  await until("the arms", async () => (await angle(main, "light")) !== "–");
  await look("idle");

  console.log("submits the quickstart by keyboard");
  await main.locator("#submit summary").focus();
  await main.keyboard.press("Enter");
  await until("the job's text", async () => (await main.locator("#job-text").inputValue()).includes("[[plane]]"));
  const text = await main.locator("#job-text").inputValue();
  // More readings than it asks for, so that there is time to look at them as they come.
  await main.locator("#job-text").fill(text.replaceAll("readings = 14", "readings = 40").replace("readings = 6", "readings = 40"));
  await main.getByRole("button", { name: "What would it do?" }).click();
  await main.getByText(/\d+ readings in/).waitFor();
  await main.getByRole("button", { name: "Add to the queue" }).focus();
  await main.keyboard.press("Enter");
  console.log("finds the button of what is wanted whole and at the head of the page, at every width");
  await until("the tab to say what is wanted", async () => /^Specimen wanted: /.test(await main.title()));
  const mark = () => main.locator("#icon").getAttribute("href");
  const wanted = await mark();
  assert.match(wanted, /^data:image\/svg/);
  for (const width of [320, 390, 768, 1024, 1280, 1920]) {
    await main.setViewportSize({ width, height: 844 });
    const { button, card, over } = await main.evaluate(() => ({
      button: document.querySelector("#wanted button").getBoundingClientRect().toJSON(),
      card: document.querySelector("#now").getBoundingClientRect().toJSON(),
      over: document.documentElement.scrollWidth - innerWidth,
    }));
    const whole = button.left >= card.left && button.right <= card.right && button.bottom < 844 / 2 && button.width > 100;
    assert(whole && over <= 0, `${width}: ${JSON.stringify({ button, card, over })}`);
  }
  await main.setViewportSize(WIDE);

  console.log("leaves the editor with Esc, which stops nothing there");
  await main.locator("#job-text").focus();
  await main.keyboard.press("Escape");
  assert.equal(await main.locator("#submit").evaluate((details) => details.open), false);
  assert.equal((await view()).fault, null, "no emergency stop");

  console.log("gives a second job up, after a question that Esc answers with no");
  await fetch(`${origin}/api/v1/jobs?name=second.toml`, { method: "POST", body: text,
    headers: { Authorization: `Bearer ${token}`, "Content-Type": "application/toml" } });
  const cancels = main.getByRole("button", { name: /^Cancel …/ });
  await until("the second job", async () => (await cancels.count()) === 2);
  await cancels.last().click();
  await main.keyboard.press("Escape");
  await main.locator("#confirm").waitFor({ state: "hidden" });
  assert.equal((await view()).fault, null, "no emergency stop");
  assert.equal(await cancels.count(), 2, "and nothing was given up");
  await cancels.last().click();
  await main.getByRole("button", { name: "Cancel the job" }).click();
  await until("the second job to go", async () => (await cancels.count()) === 1);
  await main.getByRole("button", { name: "Specimen is on the stage" }).click();

  console.log("sees the arms move and the plots fill");
  await until("the tab to say how far it is", async () => /^\d+ % /.test(await main.title()));
  assert.notEqual(await mark(), wanted, "the icon follows");
  const before = await angle(main, "light");
  await until("the light arm to move", async () => (await angle(main, "light")) !== before);
  await until("readings in G", async () => (await dots(main, "g")) >= 30);

  console.log("pauses");
  await main.getByRole("button", { name: "Pause" }).click();
  await until("paused", async () => (await main.locator("#state").textContent()) === "paused");
  await look("paused");

  console.log("reads a value by keyboard and by mouse, and goes on");
  const value = async () => main.locator("#plot-g output").textContent();
  await main.locator("#plot-g").focus();
  await main.keyboard.press("ArrowRight");
  assert.match(await value(), /^d_p .*red .*green .*blue .*sr⁻¹/);
  await main.getByRole("button", { name: "Go on" }).focus();
  await main.locator("#plot-g circle").nth(20).hover({ force: true });
  assert.match(await value(), /^d_p/);
  const taken = await dots(main, "g");
  await main.keyboard.press("Enter");
  await until("running", async () => (await main.locator("#state").textContent()) === "running");
  await until("a reading drawn under the mouse", async () => (await dots(main, "g")) > taken);
  assert.match(await value(), /^d_p/);

  console.log("presses the emergency stop's key");
  await main.keyboard.press("Escape");
  await main.getByRole("alert").getByText(/Fault: estop/).waitFor();
  await main.getByRole("alert").getByText(/What to do: Find out why/).waitFor();
  assert.match(await main.title(), /^Fault/);
  await until("the arms to stand", async () => {
    const { job, activity, arms } = await view();
    return !job && activity === "idle" && !arms.some((arm) => arm.moving);
  });
  await look("estop");

  console.log("acknowledges and resumes");
  await main.getByRole("button", { name: "Acknowledge" }).click();
  await main.getByRole("alert").waitFor({ state: "hidden" });
  const kept = await dots(main, "g");
  await main.getByRole("button", { name: "Resume" }).click();
  await until("more readings", async () => (await dots(main, "g")) > kept);
  await until("readings in F", async () => (await dots(main, "f")) >= 30);
  await look("running");

  console.log("opens the report");
  // A run that was interrupted has a report too, of what was measured until then.
  await until("the end", async () => {
    const state = await main.locator("#run-list .chip").first().textContent();
    assert.notEqual(state, "interrupted", await main.locator("#jobs").textContent());
    return state === "done";
  });
  await until("the report", async () => (await main.locator("#run-list a").count()) === 1);
  await look("done");
  await main.locator("#run-list a").click();
  await checks(main).waitFor();
  const report = main.frameLocator("#report-frame");
  assert.equal(await report.locator("img").first().evaluate((img) => img.complete && img.naturalWidth > 0), true, "the report has its pictures");
  assert.equal(await report.locator("svg").count() > 0, true, "and its plots");
  await look("report");
  const scrolls = await main.locator("#report-frame").evaluate((frame) => frame.contentDocument.documentElement.scrollHeight - frame.clientHeight);
  assert(scrolls <= 0, `the report scrolls within the page by ${scrolls} pixels`);
  await main.getByText("Files", { exact: true }).click();
  const saving = main.waitForEvent("download");
  await main.getByRole("link", { name: "readings.csv" }).click();
  assert.match((await saving).suggestedFilename(), /^[^_]+_\d{4}-\d\d-\d\d_[0-9A-Z]{6}_readings\.csv$/);
  const files = await main.locator("#files a").allTextContents();
  assert(files.includes("brdf.binary"), files);
  console.log("saves the result in another format, and all of them");
  await main.getByText("In other formats", { exact: true }).click();
  const saved = async (format) => {
    const made = main.waitForEvent("download", { timeout: LONG });
    await main.locator("#exports").getByRole("link", { name: format, exact: true }).click();
    return made;
  };
  const merl = await saved("merl");
  assert.match(merl.suggestedFilename(), /\.binary$/);
  assert(statSync(await merl.path()).size > 10_000, "the file holds something");
  const all = await saved("all");
  assert.match(all.suggestedFilename(), /\.zip$/);
  await all.cancel();
  console.log("says more of the run, and finds it again by that");
  await main.locator("#record summary").click();
  await main.getByLabel("Tags, with commas between them").fill("paint, reference");
  await main.getByRole("button", { name: "Save the record" }).click();
  await main.locator("#record-edited").getByText(/It was edited/).waitFor();
  await look("record");
  await main.getByRole("link", { name: /Back to the rig/ }).click();
  for (const [words, found] of [["refer", 1], ["nothing like it", 0]]) {
    await main.getByRole("searchbox").fill(words);
    await until(`${found} runs for ${words}`, async () => (await main.locator("#run-list tr").count()) === found);
  }
  await main.getByRole("searchbox").fill("");
  await main.locator("#filters summary").click();
  await main.getByLabel("Tag", { exact: true }).fill("PAINT");
  await until("the run by its tag", async () => (await main.locator("#run-list tr").count()) === 1);
  await main.getByRole("button", { name: "No filters" }).click();
  await main.locator("#desk").waitFor();

  console.log("is told what happened before the page was opened");
  const later = await open({ viewport: WIDE });
  await later.locator("#events").getByText(/: done$/).waitFor();
  await later.locator("#events").getByText(/^.*Fault: emergency stop/).first().waitFor();
  await later.context().close();

  console.log("estop is in sight wherever one has scrolled to");
  for (const page of [main, await open({ viewport: NARROW, isMobile: true })]) {
    await page.evaluate(() => scrollTo(0, document.body.scrollHeight));
    const box = await page.locator("#estop").boundingBox();
    const { height } = page.viewportSize();
    assert(box.y >= 0 && box.y + box.height <= height, JSON.stringify(box));
  }
  assert.deepEqual(complaints, []);
  console.log("the page is sound");
} finally {
  await browser.close();
  proxy.close();
  daemon.kill("SIGTERM");
  await new Promise((resolve) => daemon.once("exit", resolve));
  rmSync(data, { recursive: true });
}
