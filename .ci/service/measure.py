#!/usr/bin/env python3
"""Measures the daemon from outside: idle, and under load. Needs python3 alone.

  cargo build --release -p goniod
  .ci/service/measure.py target/release/goniod idle    memory, processor time, time to the first answer
  .ci/service/measure.py target/release/goniod load    50 watchers and 200 requests a second for a minute

Both end with an error where what docs/http.md promises does not hold. On a machine that is busy otherwise, times say
little.
"""

import asyncio
import json
import os
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

WATCHERS = 50
REQUESTS_PER_S = 200
LOAD_S = 60
CALM_S = 20
PRESSES = 200
IDLE_S = 30

JOB = """specimen = "load"
on_stage = true
[[plane]]
theta_r_deg = 70
readings = 2000
distribution = "uniform"
[[plane]]
theta_r_deg = 40
readings = 2000
distribution = "uniform"
"""


class Daemon:
    """A daemon on a free port, with the simulated rig in real time."""

    def __init__(self, program, folder):
        rig = Path(folder, "rig.toml")
        rig.write_text('[sim]\nclock = "real"\n')
        begun = time.monotonic()
        self.process = subprocess.Popen(
            [program, "--config", rig, "--data", Path(folder, "runs"), "--listen", "127.0.0.1:0"],
            stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, env=os.environ | {"RUST_LOG": "warn"}, text=True)
        address = self.process.stdout.readline().strip()
        self.host, port = address.removeprefix("http://").split(":")
        self.port = int(port)
        asyncio.run(self.ask("GET", "/health"))
        self.start_ms = (time.monotonic() - begun) * 1e3

    def memory_mb(self):
        pages = int(Path(f"/proc/{self.process.pid}/statm").read_text().split()[1])
        return pages * os.sysconf("SC_PAGE_SIZE") / 1e6

    def processor_s(self):
        fields = Path(f"/proc/{self.process.pid}/stat").read_text().rsplit(")", 1)[1].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    def end(self):
        self.process.send_signal(signal.SIGTERM)
        return self.process.wait(60)

    async def ask(self, method, path, body="", kind="application/toml"):
        """A request on a connection of its own: (status, body)."""
        reader, writer = await asyncio.open_connection(self.host, self.port)
        head = (f"{method} {path} HTTP/1.1\r\nHost: {self.host}:{self.port}\r\nConnection: close\r\n"
                f"Content-Type: {kind}\r\nContent-Length: {len(body)}\r\n\r\n")
        writer.write((head + body).encode())
        answer = await reader.read()
        writer.close()
        head, _, body = answer.partition(b"\r\n\r\n")
        return int(head.split()[1]), body

    async def events(self):
        """What happens, for as long as somebody asks for more."""
        reader, writer = await asyncio.open_connection(self.host, self.port)
        writer.write(f"GET /api/v1/events HTTP/1.1\r\nHost: {self.host}:{self.port}\r\n\r\n".encode())
        try:
            while line := await reader.readline():
                if line.startswith(b"data: "):
                    yield line[6:]
        finally:
            writer.close()


def check(what, value, unit, limit):
    good = value < limit
    print(f"{what}: {value:.3g} {unit} ({'good' if good else 'TOO MUCH'}, below {limit:g} is promised)")
    return good


def idle(daemon):
    before = daemon.processor_s()
    time.sleep(IDLE_S)
    used = (daemon.processor_s() - before) / IDLE_S * 100
    return all([
        check("first answer after", daemon.start_ms, "ms", 200),
        check("resident memory", daemon.memory_mb(), "MB", 30),
        check("of one core", used, "%", 0.5),
    ])


async def rate(daemon, seconds):
    """Readings a second of the run under way, by the photometer's own clock and by ours."""
    async def done():
        return json.loads((await daemon.ask("GET", "/api/v1/rig"))[1])["progress"]["done"]
    first, begun = await done(), time.monotonic()
    await asyncio.sleep(seconds)
    return (await done() - first) / (time.monotonic() - begun)


async def load(daemon):
    status, body = await daemon.ask("POST", "/api/v1/jobs?name=load.toml", JOB)
    assert status == 201, body
    while (json.loads((await daemon.ask("GET", "/api/v1/rig"))[1])["progress"] or {"done": 0})["done"] < 10:
        await asyncio.sleep(0.2)
    calm = await rate(daemon, CALM_S)
    memory = daemon.memory_mb()

    seen = [0] * WATCHERS
    async def watch(i):
        async for _ in daemon.events():
            seen[i] += 1
    answered = []
    async def press_on():
        paths = ["/api/v1/rig", "/api/v1/jobs", "/api/v1/runs", "/metrics", "/", "/health"]
        pending, due, count = set(), time.monotonic(), 0
        while True:
            async def one(path):
                begun = time.monotonic()
                status, _ = await daemon.ask("GET", path)
                answered.append((status, time.monotonic() - begun))
            task = asyncio.create_task(one(paths[count % len(paths)]))
            pending.add(task)
            task.add_done_callback(pending.discard)
            count += 1
            due += 1 / REQUESTS_PER_S
            await asyncio.sleep(max(0, due - time.monotonic()))
    burden = [asyncio.create_task(watch(i)) for i in range(WATCHERS)] + [asyncio.create_task(press_on())]
    loaded = await rate(daemon, LOAD_S)
    asked = len(answered)

    presses = []
    for _ in range(PRESSES):
        begun = time.monotonic()
        status, _ = await daemon.ask("POST", "/api/v1/estop")
        presses.append((time.monotonic() - begun) * 1e3)
        assert status == 204
        await asyncio.sleep(0.02)
        # Acknowledging may come before the fault is noted; pressing again needs none.
        await daemon.ask("POST", "/api/v1/acknowledge")
    for task in burden:
        task.cancel()
    refused = sum(status != 200 for status, _ in answered)
    times = sorted(seconds for _, seconds in answered)
    print(f"{asked} requests in {LOAD_S} s, {refused} not answered with 200; "
          f"median {statistics.median(times) * 1e3:.1f} ms, p99 {times[len(times) * 99 // 100] * 1e3:.1f} ms; "
          f"{sum(seen)} events to {WATCHERS} watchers")
    print(f"readings a second: {calm:.2f} alone, {loaded:.2f} under load")
    return all([
        refused == 0,
        check("readings lost to load", (1 - loaded / calm) * 100, "%", 5),
        check("emergency stop acknowledged, p99", sorted(presses)[PRESSES * 99 // 100], "ms", 50),
        check("memory gained under load", daemon.memory_mb() - memory, "MB", 20),
    ])


def main():
    program, what = sys.argv[1:]
    with tempfile.TemporaryDirectory() as folder:
        daemon = Daemon(program, folder)
        try:
            good = idle(daemon) if what == "idle" else asyncio.run(load(daemon))
        finally:
            ended = daemon.end()
    if ended != 0:
        print(f"it ended with {ended} on SIGTERM")
    sys.exit(0 if good and ended == 0 else 1)


if __name__ == "__main__":
    main()
