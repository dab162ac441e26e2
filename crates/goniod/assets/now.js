// What happens and what is wanted next, in one sentence: of the rig, its jobs and its latest run. Nothing of the page.

export const OVER = ["done", "failed", "cancelled"];
// What a thing is called: its specimen, else its file.
export const title = (thing) => thing.specimen || thing.name;
const quoted = (thing) => `“${title(thing)}”`;

// Each returns the sentence, and where somebody is wanted the job and the action that goes on; `mood` is that of the
// title and of the icon: fault, wanted, running or none.
const UNDER_WAY = {
  identifying: (job) => `Asking the devices who they are before ${quoted(job)} begins. Nothing is wanted.`,
  engaging: (job) => `The arms engage for ${quoted(job)}. Nothing is wanted.`,
  warming_up: (job) => `The lamp warms up for ${quoted(job)}. Nothing is wanted.`,
  running: (job, done) => `Measuring ${quoted(job)}${done}. Nothing is wanted.`,
  suspended: (job) => `${quoted(job)} holds by itself until the rig is as its file wants it; “What happened” says why.`,
  shutting_down: (job) => `${quoted(job)} ends: the lamp is off and the arms come to rest.`,
  reporting: (job) => `Writing the report of ${quoted(job)}. Nothing is wanted.`,
};

export function now({ rig, jobs, run }) {
  if (rig.fault) {
    return { mood: "fault", state: "fault", title: "Fault", text: "The rig stands still: look at it, do what stands beside the fault, then acknowledge it." };
  }
  const job = jobs.find((job) => job.id === rig.job && !OVER.includes(job.state));
  if (job) return underWay(rig, job);
  if (rig.activity === "moving") return { mood: "running", state: "moving", title: "Moving", text: "An arm is moved by hand, or both go to rest." };
  if (!rig.connected) {
    const trouble = rig.trouble ? `: ${rig.trouble}` : "";
    return { mood: "wanted", state: "no rig", title: "No rig", text: `The rig does not answer${trouble}. The daemon looks for it again by itself.` };
  }
  // Its specimen lies on the stage still, so it comes before the next one.
  const interrupted = jobs.filter((job) => job.state === "interrupted").sort((a, b) => a.changed < b.changed ? 1 : -1)[0];
  if (interrupted) {
    const why = interrupted.why ? ` (${interrupted.why})` : "";
    return { mood: "wanted", state: "interrupted", title: `Interrupted: ${title(interrupted)}`, job: interrupted, action: "resume",
      text: `${quoted(interrupted)} was interrupted${why}. Resume it, or give it up in the queue.` };
  }
  const awaiting = jobs.find((job) => job.state === "awaiting_specimen");
  if (awaiting) {
    return { mood: "wanted", state: "specimen", title: `Specimen wanted: ${title(awaiting)}`, job: awaiting, action: "ready",
      text: `Put ${quoted(awaiting)} on the stage, then say that it lies there.` };
  }
  if (run?.reported) {
    const verdict = { bad: " It was measured but is not usable: the report says why.", look: " Its checks found something to look at." }[run.verdict] ?? "";
    return { state: "done", title: `Done: ${title(run)}`, run, text: `${quoted(run)} is the latest run, and its report is ready.${verdict} Nothing waits: add a job.` };
  }
  return { state: "idle", title: "", text: "Nothing is running and nothing waits: add a job." };
}

function underWay(rig, job) {
  const progress = rig.progress;
  const done = progress ? `: ${progress.done} of ${progress.of} readings` : "";
  if (job.state === "paused") {
    return { mood: "wanted", state: "paused", title: `Paused: ${title(job)}`, job, action: "proceed",
      text: `${quoted(job)} is paused with the lamp on${done}. Go on when you are ready.` };
  }
  const name = title(job);
  const part = progress?.of ? `${Math.floor(100 * progress.done / progress.of)} % ` : "";
  if (job.state === "stopping") return { mood: "running", state: "stopping", title: `Stopping: ${name}`, text: `${quoted(job)} is being stopped. What was measured is kept.` };
  const text = (UNDER_WAY[rig.activity] ?? ((job) => `${quoted(job)} is under way. Nothing is wanted.`))(job, done);
  return { mood: "running", state: rig.activity, title: `${part}${name}`, text };
}
