"""A peer, side by side: bluesky's RunEngine with the ROBOTIS SDK takes the readings that `gonioctl run` has just taken,
on the same simulated bus, in real time.

Usage: peer.py FIRMWARE_SIM GONIOCTL JOB.toml

Both visit the same poses in the same order with the same exposures, over one terminal of one simulator whose clock is
real, first the one, then the other. The peer is spared what gonioctl does besides: finding the exposures, checking the
way, journalling each reading, watching for faults. gonioctl's seconds are those of its plane and its arc, by the
photometer's clock, lamp warm-up included; dark readings and reconstruction are left out. The peer's are wall time from
the lamp's warm-up to the last reading.
"""

import csv
import json
import signal
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import bluesky.plan_stubs as bps
import bluesky.preprocessors as bpp
from bluesky import RunEngine
from dynamixel_sdk import port_handler
from dynamixel_sdk import COMM_SUCCESS, GroupSyncWrite, PacketHandler, PortHandler

LIGHT, SENSOR, PHOTOMETER = 1, 2, 3
BAUD = 1_000_000
# The SDK waits twice this for an answer, ms, as in robotis_sdk.py: it busies the processor meanwhile.
port_handler.LATENCY_TIMER = 100
# Registers of the X series (e-manual) and of the photometer (docs/photometer.md).
TORQUE_ENABLE, PROFILE_ACCELERATION, PROFILE_VELOCITY, GOAL_POSITION = 64, 108, 112, 116
MOVING, PRESENT_POSITION = 122, 132
LAMP_ENABLE, INTEGRATION_TIME, STATUS, COUNTS = 64, 104, 120, 132
# As config/rig.toml: 60°/s and 200°/s² in the servo's units, 0.1° in counts, s.
VELOCITY, ACCELERATION, TOLERANCE, SETTLE, WARM_UP = 43, 9, 1.14, 0.02, 0.2
GAINS = {"1": 0, "16": 1, "256": 2}


class Bus:
    """One port for all devices, one transaction at a time."""

    def __init__(self, path):
        self.port, self.sdk, self.lock = PortHandler(path), PacketHandler(2.0), threading.Lock()
        assert self.port.openPort() and self.port.setBaudRate(BAUD)

    def read(self, id_, address, length):
        with self.lock:
            data, result, error = self.sdk.readTxRx(self.port, id_, address, length)
        assert (result, error) == (COMM_SUCCESS, 0), (id_, address, result, error)
        return int.from_bytes(bytes(data), "little")

    def write(self, id_, address, length, value):
        with self.lock:
            result, error = self.sdk.writeTxRx(self.port, id_, address, length, list(value.to_bytes(length, "little")))
        assert (result, error) == (COMM_SUCCESS, 0), (id_, address, result, error)

    def start(self, goals):
        """Both arms off together, as gonioctl does."""
        group = GroupSyncWrite(self.port, self.sdk, GOAL_POSITION, 4)
        for id_, goal in goals.items():
            assert group.addParam(id_, list(goal.to_bytes(4, "little")))
        with self.lock:
            assert group.txPacket() == COMM_SUCCESS


class Status:
    """What bluesky waits for: a thread's end."""

    def __init__(self, work):
        self.done, self.success, self.failure, self.callbacks = False, False, None, []
        self.lock = threading.Lock()
        threading.Thread(target=self.run, args=(work,), daemon=True).start()

    def run(self, work):
        try:
            work()
        except Exception as failure:
            self.failure = failure
        with self.lock:
            self.done, self.success = True, self.failure is None
            callbacks = list(self.callbacks)
        for callback in callbacks:
            callback(self)

    def add_callback(self, callback):
        with self.lock:
            if not self.done:
                self.callbacks.append(callback)
                return
        callback(self)

    def exception(self, timeout=0.0):
        return self.failure


class Arms:
    """Both servos as one movable."""

    name, parent = "arms", None

    def __init__(self, bus):
        self.bus, self.goals = bus, {}
        for id_ in LIGHT, SENSOR:
            bus.write(id_, PROFILE_ACCELERATION, 4, ACCELERATION)
            bus.write(id_, PROFILE_VELOCITY, 4, VELOCITY)
            bus.write(id_, TORQUE_ENABLE, 1, 1)

    def set(self, pose):
        self.goals = dict(zip((LIGHT, SENSOR), (counts(angle) for angle in pose)))
        return Status(self.travel)

    def travel(self):
        self.bus.start(self.goals)
        while not all(self.arrived(id_) for id_ in self.goals):
            pass
        time.sleep(SETTLE)

    def arrived(self, id_):
        if self.bus.read(id_, MOVING, 1):
            return False
        return abs(self.bus.read(id_, PRESENT_POSITION, 4) - self.goals[id_]) <= TOLERANCE

    def read(self):
        now = time.time()
        return {f"arm_{id_}": {"value": self.bus.read(id_, PRESENT_POSITION, 4), "timestamp": now} for id_ in self.goals}

    def describe(self):
        return {f"arm_{id_}": {"source": f"bus:{id_}", "dtype": "integer", "shape": []} for id_ in (LIGHT, SENSOR)}

    def read_configuration(self):
        return {}

    def describe_configuration(self):
        return {}


class Photometer(Arms):
    """The node as a triggerable."""

    name = "photometer"

    def __init__(self, bus):
        self.bus, self.exposure = bus, (1000, 0)
        bus.write(PHOTOMETER, LAMP_ENABLE, 1, 1)
        time.sleep(WARM_UP)

    def trigger(self):
        return Status(self.expose)

    def expose(self):
        integration_us, gain = self.exposure
        self.bus.write(PHOTOMETER, INTEGRATION_TIME, 6, integration_us | gain << 32 | 1 << 40)
        time.sleep(integration_us / 1e6)
        while self.bus.read(PHOTOMETER, STATUS, 1) == 1:
            pass

    def read(self):
        data = self.bus.read(PHOTOMETER, COUNTS, 16)
        channels = {name: data >> 32 * i & 0xFFFFFF for i, name in enumerate(("red", "green", "blue", "monitor"))}
        return {name: {"value": value, "timestamp": time.time()} for name, value in channels.items()}

    def describe(self):
        return {name: {"source": "bus:3", "dtype": "integer", "shape": []} for name in ("red", "green", "blue", "monitor")}


def counts(angle_deg):
    return round(2048 + angle_deg / 360 * 4096)


def plan(arms, photometer, readings):
    @bpp.run_decorator()
    def inner():
        for light, sensor, integration_us, gain, *_ in readings:
            photometer.exposure = integration_us, gain
            yield from bps.mv(arms, (light, sensor))
            yield from bps.trigger_and_read([photometer, arms])

    return inner()


def peer(path, readings):
    """Seconds and the events' documents."""
    events = []
    engine = RunEngine()
    engine.subscribe(lambda _, document: events.append(document["data"]), "event")
    begun = time.monotonic()
    bus = Bus(path)
    arms, photometer = Arms(bus), Photometer(bus)
    engine(plan(arms, photometer, readings))
    seconds = time.monotonic() - begun
    bus.write(PHOTOMETER, LAMP_ENABLE, 1, 0)
    bus.port.closePort()
    return seconds, events


def gonioctl(program, job, path, directory):
    """Seconds of the sweeps, exposures in them, and the readings that count."""
    rig = directory / "rig.toml"
    rig.write_text(f'[bus]\nport = "{path}"\n')
    command = [program, "run", job, "--rig", rig, "--out", directory / "runs"]
    run = Path(subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout.strip())
    with (run / "readings.csv").open() as lines:
        lit = [row for row in csv.DictReader(lines) if row["sweep"] != "dark"]
    phases = json.loads((run / "run.json").read_text())["seconds"]["phases"]
    seconds = sum(s for phase, s in phases.items() if phase.startswith(("plane", "arc")))
    return seconds, len(lit), [row for row in lit if row["accepted"] == "true"]


def agree(row, event):
    """The readings of one pose: relative to the lamp monitor, but for noise and drift."""
    ours = int(row["counts_g"]) / int(row["counts_monitor"])
    theirs = event["green"] / event["monitor"]
    return abs(theirs / ours - 1)


def main():
    simulator, program, job = sys.argv[1:]
    with tempfile.TemporaryDirectory() as directory:
        bench = subprocess.Popen([simulator], stdout=subprocess.PIPE, text=True)
        try:
            path = bench.stdout.readline().strip()
            ours, exposures, rows = gonioctl(program, job, path, Path(directory))
            wanted = [
                (float(row["light_commanded_deg"]), float(row["sensor_commanded_deg"]),
                 int(row["integration_us"]), GAINS[row["gain"]])
                for row in rows
            ]
            theirs, events = peer(path, wanted)
        finally:
            bench.send_signal(signal.SIGINT)
            bench.wait()
    assert len(events) == len(rows) > 0, (len(events), len(rows))
    worst = sorted(map(agree, rows, events))
    assert worst[len(worst) // 2] < 0.02, f"the two do not measure the same: {worst}"
    print(f"{'':24} poses  exposures  seconds  poses/s")
    for name, taken, seconds in ("gonioctl run", exposures, ours), ("bluesky + ROBOTIS SDK", len(events), theirs):
        print(f"{name:24} {len(rows):5}  {taken:9}  {seconds:7.1f}  {len(rows) / seconds:7.2f}")


if __name__ == "__main__":
    main()
