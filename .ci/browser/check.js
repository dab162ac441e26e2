// Drives the page as a technician would, on a simulated rig in real time; looks at it wide and narrow, light and dark.
// Usage: node check.js GONIOD DIR

import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { createInterface } from "node:readline";
import { chromium } from "playwright-core";

const [goniod, shots] = process.argv.slice(2);
const axe = readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");
// What a capture takes in real time, with room for a busy machine.
const LONG = 240_000;

const data = mkdtempSync(join(tmpdir(), "goniod-browser-"));
const rig = join(data, "rig.toml");
// Where Chromium takes all cores, the daemon may be late for more than the second that servos wait by default.
writeFileSync(rig, '[motion]\nwatchdog_ms = 2540\n[sim]\nclock = "real"\n');
const daemon = spawn(goniod, ["--config", rig, "--data", join(data, "runs"), "--listen", "127.0.0.1:0"], { stdio: ["ignore", "pipe", "inherit"] });
const [address] = await new Promise((resolve, reject) => {
  createInterface(daemon.stdout).once("line", (line) => resolve([line]));
  daemon.once("exit", (code) => reject(new Error(`goniod ended with ${code}`)));
});
const browser = await chromium.launch({ executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium", args: ["--no-sandbox"] });
const complaints = [];

async function open(options) {
  const context = await browser.newContext({ reducedMotion: "no-preference", ...options });
  const page = await context.newPage();
  page.setDefaultTimeout(LONG);
  page.on("console", (message) => { if (["error", "warning"].includes(message.type())) complaints.push(`console: ${message.text()} (${message.location().url})`); });
  page.on("pageerror", (error) => complaints.push(`page: ${error.stack}`));
  page.on("request", (request) => { if (!request.url().startsWith(address) && !request.url().startsWith("data:")) complaints.push(`fetched ${request.url()}`); });
  await page.goto(address);
  await page.getByText("connected", { exact: true }).waitFor();
  return page;
}

// What the page looks like in every size and colour, and whether anybody can read and operate it.
async function look(name) {
  for (const [size, viewport] of Object.entries({ wide: { width: 1280, height: 900 }, narrow: { width: 390, height: 844 } })) {
    for (const colorScheme of ["light", "dark"]) {
      const page = pages[`${size} ${colorScheme}`] ??= await open({ viewport, colorScheme, isMobile: size === "narrow" });
      await page.bringToFront();
      if (new URL(page.url()).hash !== new URL(main.url()).hash) await page.goto(main.url());
      await page.getByText("connected", { exact: true }).waitFor();
      await page.waitForTimeout(500);
      await page.screenshot({ path: join(shots, `${name}-${size}-${colorScheme}.png`), fullPage: true });
      const wide = await page.evaluate(() => document.documentElement.scrollWidth - innerWidth);
      if (wide > 0) complaints.push(`${name} ${size}: ${wide} pixels too wide`);
      await page.evaluate(axe);
      const { violations } = await page.evaluate(() => axe.run(document, { iframes: false }));
      for (const { id, help, nodes } of violations) {
        complaints.push(`axe: ${name} ${size} ${colorScheme}: ${id}: ${help}: ${nodes.map((n) => `${n.target} ${n.failureSummary}`).join("; ")}`);
      }
    }
  }
  await main.bringToFront();
}

const pages = {};
const dots = (page, plot) => page.locator(`#plot-${plot} circle`).count();
const angle = async (page, arm) => page.locator(`#${arm}`).textContent();
const until = async (what, holds) => {
  const end = Date.now() + LONG;
  while (!(await holds())) {
    assert(Date.now() < end, `waited in vain for: ${what}`);
    await main.waitForTimeout(100);
  }
};

let main;
try {
  main = await open({ viewport: { width: 1280, height: 900 }, colorScheme: "light" });
  await until("the arms", async () => (await angle(main, "light")) !== "–");
  await look("idle");

  console.log("submits the quickstart by keyboard");
  await main.locator("#submit summary").focus();
  await main.keyboard.press("Enter");
  await until("the job's text", async () => (await main.locator("#job-text").inputValue()).includes("[[plane]]"));
  const text = await main.locator("#job-text").inputValue();
  await main.locator("#job-text").fill(text.replace("on_stage = true", "on_stage = false"));
  await main.getByRole("button", { name: "What would it do?" }).click();
  await main.getByText(/\d+ readings in/).waitFor();
  await main.getByRole("button", { name: "Add to the queue" }).focus();
  await main.keyboard.press("Enter");
  await main.getByRole("button", { name: "Specimen is on the stage" }).click();

  console.log("sees the arms move and the plots fill");
  const before = await angle(main, "light");
  await until("the light arm to move", async () => (await angle(main, "light")) !== before);
  await until("readings in G", async () => (await dots(main, "g")) >= 30);

  console.log("pauses");
  await main.getByRole("button", { name: "Pause" }).click();
  await until("paused", async () => (await main.locator("#state").textContent()) === "paused");
  await look("paused");

  // Each new reading draws the plot anew, under the mouse.
  console.log("reads a value by mouse and by keyboard, and goes on");
  const dot = await main.locator("#plot-g circle").nth(20).boundingBox();
  await main.locator("#plot-g").scrollIntoViewIfNeeded();
  await main.locator("#plot-g circle").nth(20).hover({ force: true });
  assert.match(await main.locator("#plot-g output").textContent(), /^d_p .*red .*green .*blue .*sr⁻¹/, JSON.stringify(dot));
  await main.locator("#plot-g").focus();
  await main.keyboard.press("ArrowRight");
  assert.match(await main.locator("#plot-g output").textContent(), /^d_p/);

  await main.getByRole("button", { name: "Go on" }).click();
  await until("running", async () => (await main.locator("#state").textContent()) === "running");

  console.log("presses the emergency stop's key");
  await main.keyboard.press("Escape");
  await main.getByRole("alert").getByText(/Fault: estop/).waitFor();
  await until("the arms to stand", async () => {
    const first = await angle(main, "light");
    await main.waitForTimeout(500);
    return first === (await angle(main, "light"));
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
    const state = await main.locator("#run-list .chip").textContent();
    assert.notEqual(state, "interrupted", await main.getByRole("alert").textContent());
    return state === "done";
  });
  await until("the report", async () => (await main.locator("#run-list a").count()) === 1);
  await look("done");
  await main.locator("#run-list a").click();
  const report = main.frameLocator("#report-frame");
  await report.getByRole("heading", { name: "Checks" }).waitFor();
  assert.equal(await report.locator("img").first().evaluate((img) => img.complete && img.naturalWidth > 0), true, "the report has its pictures");
  assert.equal(await report.locator("svg").count() > 0, true, "and its plots");
  await look("report");
  const files = await main.locator("#files a").allTextContents();
  assert(files.includes("brdf.binary"), files);
  await main.getByRole("link", { name: /Back to the rig/ }).click();
  await main.locator("#desk").waitFor();

  console.log("estop is in sight wherever one has scrolled to");
  for (const page of [main, pages["narrow light"]]) {
    await page.goto(`${address}/#`);
    await page.evaluate(() => scrollTo(0, document.body.scrollHeight));
    const box = await page.locator("#estop").boundingBox();
    const { height } = page.viewportSize();
    assert(box.y >= 0 && box.y + box.height <= height, JSON.stringify(box));
  }
  assert.deepEqual(complaints, []);
  console.log("the page is sound");
} finally {
  await browser.close();
  daemon.kill("SIGTERM");
  await new Promise((resolve) => daemon.once("exit", resolve));
  rmSync(data, { recursive: true });
}
