#!/usr/bin/env python3
"""Measures the daemon from outside. Needs python3 alone.

  cargo build --release -p goniod -p firmware-sim
  .ci/service/measure.py target/release/goniod idle    memory, processor time, time to the first answer
  .ci/service/measure.py target/release/goniod load    readings a second while 50 watch and 200 requests a second come
  .ci/service/measure.py target/release/goniod stop    emergency stops under that load: acknowledged, and on the wire
  .ci/service/measure.py target/release/goniod flood   emergency stops, over TCP, the Unix socket and by gonioctl, while
                                                       others open sockets and do not read, or send stops without end;
                                                       needs gonioctl beside goniod
  .ci/service/measure.py target/release/goniod night   memory over a thousand runs in simulated time

Each ends with an error where what docs/http.md promises does not hold. On a machine that is busy otherwise, times say
little; what else it did is printed beside them.
"""

import asyncio
import contextlib
import json
import multiprocessing
import os
import pty
import random
import select
import shutil
import signal
import socket
import statistics
import subprocess
import sys
import tempfile
import time
import tomllib
import tty
from pathlib import Path

WATCHERS = 50
REQUESTS_PER_S = 200
LOAD_S = 60
CALM_S = 20
PRESSES = 40
IDLE_S = 30
RUNS = 1000
# Sockets that ask for the page and never read, of each kind of listener.
UNREAD = 520
# Connections that send stops without end.
STOPPERS = 8
FLOOD_PRESSES = 100
# Runs that are queued at once.
BATCH = 20
# Runs after which memory should have found its level.
SETTLED = 100

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
SHORT_JOB = """specimen = "night"
on_stage = true
[[plane]]
theta_r_deg = 60
readings = 12
[arc]
readings = 8
"""


class Daemon:
    """A daemon on a free port, with a rig."""

    def __init__(self, program, folder, rig, *more):
        self.program, self.data = Path(program), Path(folder, "data")
        file = Path(folder, "rig.toml")
        file.write_text(rig)
        begun = time.monotonic()
        self.process = subprocess.Popen(
            [program, "--config", file, "--data", self.data, "--listen", "127.0.0.1:0", *more],
            stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, env=os.environ | {"RUST_LOG": "warn"}, text=True)
        address = self.process.stdout.readline().strip()
        self.host, port = address.removeprefix("http://").split(":")
        # Made before it says where it listens.
        self.token = tomllib.loads(Path(self.data, "tokens.toml").read_text())["operate"]
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
                f"Authorization: Bearer {self.token}\r\n"
                f"Content-Type: {kind}\r\nContent-Length: {len(body)}\r\n\r\n")
        writer.write((head + body).encode())
        answer = await reader.read()
        writer.close()
        head, _, body = answer.partition(b"\r\n\r\n")
        return int(head.split()[1]), body

    async def read(self, path):
        status, body = await self.ask("GET", path)
        assert status == 200, (path, status, body)
        return json.loads(body)

    async def submit(self, job):
        status, body = await self.ask("POST", "/api/v1/jobs?name=measure.toml", job)
        assert status == 201, (status, body)
        return json.loads(body)["id"]

    async def events(self):
        """What happens, for as long as somebody asks for more."""
        reader, writer = await asyncio.open_connection(self.host, self.port)
        writer.write((f"GET /api/v1/events HTTP/1.1\r\nHost: {self.host}:{self.port}\r\n"
                      f"Authorization: Bearer {self.token}\r\n\r\n").encode())
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


async def readings(daemon):
    return ((await daemon.read("/api/v1/rig"))["progress"] or {"done": 0})["done"]


async def rate(daemon, seconds):
    """Readings a second of the run under way."""
    first, begun = await readings(daemon), time.monotonic()
    await asyncio.sleep(seconds)
    return (await readings(daemon) - first) / (time.monotonic() - begun)


@contextlib.asynccontextmanager
async def burden(daemon):
    """Watchers and requests, as many as are to be borne, and what became of them."""
    seen, answered = [0] * WATCHERS, []

    async def watch(i):
        async for _ in daemon.events():
            seen[i] += 1

    async def one(path):
        begun = time.monotonic()
        status, _ = await daemon.ask("GET", path)
        answered.append((status, time.monotonic() - begun))

    async def press_on():
        paths = ["/api/v1/rig", "/api/v1/jobs", "/api/v1/runs", "/metrics", "/", "/health"]
        due, count = time.monotonic(), 0
        async with asyncio.TaskGroup() as group:
            while True:
                group.create_task(one(paths[count % len(paths)]))
                count += 1
                due += 1 / REQUESTS_PER_S
                await asyncio.sleep(max(0, due - time.monotonic()))

    begun = time.monotonic()
    tasks = [asyncio.create_task(watch(i)) for i in range(WATCHERS)] + [asyncio.create_task(press_on())]
    yield answered
    lasted = time.monotonic() - begun
    for task in tasks:
        task.cancel()
    await asyncio.gather(*tasks, return_exceptions=True)
    times = sorted(seconds for _, seconds in answered)
    refused = sum(status != 200 for status, _ in answered)
    print(f"{len(times) / lasted:.0f} requests a second for {lasted:.0f} s, {refused} not answered with 200; "
          f"median {statistics.median(times) * 1e3:.1f} ms, p99 {p99(times) * 1e3:.1f} ms; "
          f"{sum(seen)} events to {WATCHERS} watchers; load average {os.getloadavg()[0]:.1f}")


def p99(values):
    return sorted(values)[len(values) * 99 // 100]


async def load(daemon):
    await daemon.submit(JOB)
    while await readings(daemon) < 10:
        await asyncio.sleep(0.2)
    before = await rate(daemon, CALM_S)
    memory = daemon.memory_mb()
    async with burden(daemon) as answered:
        loaded = await rate(daemon, LOAD_S)
        gained = daemon.memory_mb() - memory
    after = await rate(daemon, CALM_S)
    await daemon.ask("POST", "/api/v1/stop")
    calm = (before + after) / 2
    print(f"readings a second: {before:.2f} before, {loaded:.2f} under load, {after:.2f} after")
    return all([
        all(status == 200 for status, _ in answered),
        check("readings lost to load", (1 - loaded / calm) * 100, "%", 5),
        check("memory gained under load", gained, "MB", 20),
    ])


def tap(bus, told):
    """Sits on the wire between the daemon and a simulated bus and tells when both servos have an emergency stop: their
    profile off, then a goal."""
    profile_off = bytes([0x03, 108, 0]) + bytes(8)
    goal = bytes([0x03, 116, 0])
    device = os.open(bus, os.O_RDWR | os.O_NOCTTY)
    host, other = pty.openpty()
    for terminal in (device, host, other):
        tty.setraw(terminal)
    told.send(os.ttyname(other))
    kept, stopping, stopped = b"", set(), set()
    while True:
        ready, _, _ = select.select([host, device], [], [])
        if device in ready:
            os.write(host, os.read(device, 4096))
        if host not in ready:
            continue
        data = os.read(host, 4096)
        os.write(device, data)
        # Protocol 2.0: header, id, length, instruction, parameters, CRC.
        *packets, kept = (kept + data).split(b"\xff\xff\xfd\x00")
        if len(kept) > 3 and len(kept) >= 3 + int.from_bytes(kept[1:3], "little"):
            packets, kept = packets + [kept], b""
        for packet in packets:
            servo, instruction = packet[:1], packet[3:-2]
            if instruction == profile_off:
                stopping.add(servo)
            elif servo in stopping and instruction[:3] == goal:
                stopped.add(servo)
            if len(stopped) == 2:
                told.send(time.monotonic())
                stopping, stopped = set(), set()


async def stop(daemon, told):
    """Presses the emergency stop again and again while the arms move, and goes on each time."""
    job = await daemon.submit(JOB)
    acknowledged, stopped = [], []
    async with burden(daemon):
        for _ in range(PRESSES):
            done = await readings(daemon)
            while await readings(daemon) <= done:
                await asyncio.sleep(0.05)
            await asyncio.sleep(random.uniform(0, 0.3))
            # A stop may be told more than once, since whoever watches the rig repeats it.
            while told.poll():
                told.recv()
            begun = time.monotonic()
            status, body = await daemon.ask("POST", "/api/v1/estop")
            assert status == 204, (status, body)
            acknowledged.append((time.monotonic() - begun) * 1e3)
            assert await asyncio.to_thread(told.poll, 5), "no stop on the wire"
            stopped.append((told.recv() - begun) * 1e3)
            fault = (await daemon.read("/api/v1/rig"))["fault"]["id"]
            for path, body in [("/api/v1/acknowledge", json.dumps({"fault": fault})), (f"/api/v1/jobs/{job}/resume", "")]:
                while (answer := await daemon.ask("POST", path, body, "application/json"))[0] not in (200, 204):
                    # The arms come to rest first, and what was measured is reported.
                    assert answer[0] == 409, answer
                    await asyncio.sleep(0.1)
    await daemon.ask("POST", "/api/v1/stop")
    for what, times in [("acknowledged", acknowledged), ("on the wire", stopped)]:
        print(f"{what} after {statistics.median(times):.1f} ms in the median of {PRESSES} presses, at most {max(times):.1f} ms")
    return all([
        check("emergency stop acknowledged, p99", p99(acknowledged), "ms", 50),
        check("both servos have it, p99", p99(stopped), "ms", 100),
    ])


class Flood:
    """Emergency stops past those who flood the daemon: sent, and seen by the simulated servos."""

    def __init__(self, daemon, folder, trace):
        self.daemon, self.trace, self.socket = daemon, trace, Path(folder, "goniod.sock")
        self.token = daemon.token
        self.token_file = Path(folder, "token")
        self.token_file.write_text(self.token)
        self.token_file.chmod(0o600)

    def connect(self, unix):
        if unix:
            connection = socket.socket(socket.AF_UNIX)
            connection.connect(str(self.socket))
        else:
            connection = socket.create_connection((self.daemon.host, self.daemon.port))
        return connection

    def request(self, method, path):
        return (f"{method} {path} HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer {self.token}\r\n"
                "Content-Length: 0\r\n\r\n").encode()

    def unread(self):
        """Sockets that ask for the page again and again and never read; replaced as the daemon closes them."""
        page = b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n"
        kept = {unix: [] for unix in (False, True)}
        while True:
            for unix, sockets in kept.items():
                with contextlib.suppress(OSError):
                    connection = self.connect(unix)
                    connection.setblocking(False)
                    connection.send(page * 20)
                    sockets.append(connection)
                if len(sockets) > UNREAD:
                    sockets.pop(0).close()
            if len(kept[True]) >= UNREAD:
                time.sleep(0.01)

    def stoppers(self):
        """Sends stops as fast as they are taken, and reads the answers without looking at them."""
        many = self.request("POST", "/api/v1/stop") * 200
        sockets = [self.connect(unix=i % 2 == 1) for i in range(STOPPERS)]
        for connection in sockets:
            connection.setblocking(False)
        rest = dict.fromkeys(sockets, b"")
        while True:
            readable, writable, _ = select.select(sockets, sockets, [])
            for connection in readable:
                with contextlib.suppress(BlockingIOError):
                    connection.recv(1 << 20)
            for connection in writable:
                # The rest of a request that was cut short comes first the next time.
                with contextlib.suppress(BlockingIOError):
                    rest[connection] = (rest[connection] or many)[connection.send(rest[connection] or many):]

    def press(self, way):
        """Presses once; returns how long it took until both servos had it, ms."""
        # An earlier stop may be told more than once.
        while self.trace.lines(0):
            pass
        begun = time.time()
        if way == "gonioctl":
            subprocess.run([self.daemon.program.with_name("gonioctl"), "estop", "--daemon", f"unix:{self.socket}",
                            "--token-file", self.token_file], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        else:
            with self.connect(unix=way == "unix") as connection:
                connection.sendall(self.request("POST", "/api/v1/estop"))
                answer = connection.recv(4096)
                assert answer.startswith(b"HTTP/1.1 204"), answer
        return (self.stopped(begun) - begun) * 1e3

    def stopped(self, begun):
        """When both servos had their profile off, and then a goal."""
        stopping, stopped = set(), set()
        while time.time() < begun + 5:
            for line in self.trace.lines(0.2):
                if line["address"] == 108 and not any(line["bytes"]):
                    stopping.add(line["id"])
                elif line["address"] == 116 and line["id"] in stopping:
                    stopped.add(line["id"])
                if len(stopped) == 2:
                    return line["unix_s"]
        raise AssertionError("no stop on the wire")

    def measure(self):
        good = []
        for flooded in (self.unread, self.stoppers):
            nuisance = multiprocessing.Process(target=flooded, daemon=True)
            nuisance.start()
            time.sleep(3)
            for way in ("tcp", "unix", "gonioctl"):
                times = []
                for _ in range(FLOOD_PRESSES):
                    times.append(self.press(way))
                    time.sleep(0.02)
                print(f"{flooded.__name__}, {way}: median {statistics.median(times):.1f} ms of {FLOOD_PRESSES} presses; "
                      f"load average {os.getloadavg()[0]:.1f}")
                good.append(check("both servos have it, at most", max(times), "ms", 100))
            nuisance.terminate()
            nuisance.join()
        return all(good)


class Trace:
    """What the simulated bus tells that the host wrote."""

    def __init__(self, path):
        os.mkfifo(path)
        self.file, self.kept = os.open(path, os.O_RDONLY | os.O_NONBLOCK), b""

    def lines(self, wait_s):
        """What has come, after waiting for so long at most."""
        if not select.select([self.file], [], [], wait_s)[0]:
            return []
        *lines, self.kept = (self.kept + os.read(self.file, 1 << 16)).split(b"\n")
        return [json.loads(line) for line in lines]


@contextlib.contextmanager
def traced_bus(program, folder):
    """A simulated bus in real time: its port, and what it tells."""
    path = Path(folder, "trace")
    trace = Trace(path)
    bus = subprocess.Popen([Path(program).with_name("firmware-sim"), "--trace", path], stdout=subprocess.PIPE,
                           stderr=subprocess.DEVNULL, text=True)
    try:
        yield bus.stdout.readline().strip(), trace
    finally:
        bus.terminate()
        bus.wait()


async def night(daemon):
    """Short runs one after the other; their directories are removed, or they would fill the disk. Memory is read where
    nothing runs: which moment of a report is met makes 40 MB."""
    removed, levels, begun = set(), [], time.monotonic()
    while len(removed) < RUNS:
        for _ in range(BATCH):
            await daemon.submit(SHORT_JOB)
        due = len(removed) + BATCH
        while len(removed) < due:
            await asyncio.sleep(0.2)
            for run in await daemon.read("/api/v1/runs"):
                if run["reported"] and run["id"] not in removed:
                    assert run["accepted"] == run["planned"], run
                    shutil.rmtree(run["directory"])
                    removed.add(run["id"])
        levels.append(daemon.memory_mb())
        print(f"{len(removed)} runs, {time.monotonic() - begun:.0f} s: {levels[-1]:.1f} MB", flush=True)
    settled = levels[SETTLED // BATCH - 1:]
    return check("memory gained since it settled", statistics.mean(settled[-5:]) - statistics.mean(settled[:5]), "MB", 10)


@contextlib.contextmanager
def tapped_bus(program):
    """A simulated bus in real time behind a tap: the port, and where the tap tells what it saw."""
    bus = subprocess.Popen([Path(program).with_name("firmware-sim")], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    ours, theirs = multiprocessing.Pipe()
    wire = multiprocessing.Process(target=tap, args=(bus.stdout.readline().strip(), theirs))
    wire.start()
    try:
        yield ours.recv(), ours
    finally:
        wire.terminate()
        bus.terminate()
        bus.wait()


def measure(program, what, folder, stack):
    more = []
    if what == "flood":
        port, trace = stack.enter_context(traced_bus(program, folder))
        rig = f'[bus]\nport = "{port}"\n'
        more = ["--listen", f"unix:{folder}/goniod.sock"]
    elif what == "stop":
        port, told = stack.enter_context(tapped_bus(program))
        rig = f'[bus]\nport = "{port}"\n'
    else:
        rig = f'[sim]\nclock = "{"wire" if what == "night" else "real"}"\n'
    daemon = Daemon(program, folder, rig, *more)
    try:
        good = {
            "idle": lambda: idle(daemon),
            "load": lambda: asyncio.run(load(daemon)),
            "stop": lambda: asyncio.run(stop(daemon, told)),
            "flood": lambda: Flood(daemon, folder, trace).measure(),
            "night": lambda: asyncio.run(night(daemon)),
        }[what]()
    finally:
        ended = daemon.end()
    if ended != 0:
        print(f"it ended with {ended} on SIGTERM")
    return good and ended == 0


def main():
    program, what = sys.argv[1:]
    with tempfile.TemporaryDirectory() as folder, contextlib.ExitStack() as stack:
        sys.exit(0 if measure(program, what, folder, stack) else 1)


if __name__ == "__main__":
    main()
