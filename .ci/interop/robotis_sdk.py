"""Talks to firmware-sim as a user of the ROBOTIS SDK would, in real time and in wire time.

Usage: robotis_sdk.py FIRMWARE_SIM
"""

import contextlib
import signal
import subprocess
import sys
import tempfile
import time
import traceback
from pathlib import Path

from dynamixel_sdk import port_handler
from dynamixel_sdk import (
    BROADCAST_ID,
    COMM_RX_TIMEOUT,
    COMM_SUCCESS,
    DXL_HIBYTE,
    DXL_HIWORD,
    DXL_LOBYTE,
    DXL_LOWORD,
    GroupBulkRead,
    GroupBulkWrite,
    GroupSyncRead,
    GroupSyncWrite,
    PacketHandler,
    PortHandler,
)

LIGHT, SENSOR, PHOTOMETER = 1, 2, 3
XM430_W350, OUR_PHOTOMETER = 1020, 0x4750
BAUD = 1_000_000
# Longest host time that anything here may take, s.
PATIENCE = 20.0
# The SDK waits twice this for an answer, ms. Its own 16 is too little on a machine that compiles something meanwhile,
# where the SDK's busy loop keeps the simulator off the processor.
port_handler.LATENCY_TIMER = 100

# Friction takes three counts of a servo as it is delivered, and a tremble and the rounding one each.
NEAR = 5

# Registers of the X series (e-manual).
MODEL_NUMBER, ID, RETURN_DELAY, OPERATING_MODE = 0, 7, 9, 11
TORQUE_ENABLE, LED, STATUS_RETURN_LEVEL, REGISTERED = 64, 65, 68, 69
POSITION_P_GAIN, PROFILE_ACCELERATION, PROFILE_VELOCITY, GOAL_POSITION = 84, 108, 112, 116
MOVING, MOVING_STATUS, PRESENT_POSITION, INDIRECT_DATA = 122, 123, 132, 224
# Of the photometer (docs/photometer.md).
LAMP_ENABLE, INTEGRATION_TIME, STATUS, SEQUENCE, MONITOR, CLOCK, DELAY = 64, 104, 120, 124, 144, 200, 204

# Error numbers of Protocol 2.0.
DATA_RANGE, ACCESS = 4, 7


def le(value, length=4):
    low, high = DXL_LOWORD(value), DXL_HIWORD(value)
    return [DXL_LOBYTE(low), DXL_HIBYTE(low), DXL_LOBYTE(high), DXL_HIBYTE(high)][:length]


def equal(found, wanted, what=""):
    assert found == wanted, f"{what} {found!r}, wanted {wanted!r}"


class Bus:
    """The SDK's port and packet handler, with its result codes checked."""

    def __init__(self, path):
        self.port, self.sdk = PortHandler(path), PacketHandler(2.0)
        assert self.port.openPort() and self.port.setBaudRate(BAUD)

    def good(self, answer, error=0):
        *values, result, code = answer
        equal((result, code), (COMM_SUCCESS, error), "result and error")
        return values[0] if values else None

    def read(self, id_, address, length):
        call = {1: self.sdk.read1ByteTxRx, 2: self.sdk.read2ByteTxRx, 4: self.sdk.read4ByteTxRx}[length]
        return self.good(call(self.port, id_, address))

    def write(self, id_, address, length, value, error=0):
        call = {1: self.sdk.write1ByteTxRx, 2: self.sdk.write2ByteTxRx, 4: self.sdk.write4ByteTxRx}[length]
        self.good(call(self.port, id_, address, value), error)

    def sync_write(self, address, length, values):
        group = GroupSyncWrite(self.port, self.sdk, address, length)
        for id_, value in values.items():
            assert group.addParam(id_, le(value, length))
        equal(group.txPacket(), COMM_SUCCESS, "sync write")

    def sync_read(self, address, length, ids, fast=False):
        group = GroupSyncRead(self.port, self.sdk, address, length)
        for id_ in ids:
            assert group.addParam(id_)
        equal(group.fastSyncRead() if fast else group.txRxPacket(), COMM_SUCCESS, "sync read")
        return {id_: group.getData(id_, address, length) for id_ in ids}

    def bulk_read(self, wanted, fast=False):
        group = GroupBulkRead(self.port, self.sdk)
        for id_, (address, length) in wanted.items():
            assert group.addParam(id_, address, length)
        equal(group.fastBulkRead() if fast else group.txRxPacket(), COMM_SUCCESS, "bulk read")
        return {id_: group.getData(id_, address, length) for id_, (address, length) in wanted.items()}

    def until(self, done, what):
        begun = time.monotonic()
        while not done():
            assert time.monotonic() - begun < PATIENCE, f"{what} took too long"

    def wait(self, seconds):
        """Lets time pass on the bench."""
        if self.read(PHOTOMETER, CLOCK, 1) == 1:
            self.write(PHOTOMETER, DELAY, 4, int(seconds * 1e6))
        else:
            time.sleep(seconds)

    def answers(self, id_):
        return self.sdk.ping(self.port, id_)[1] == COMM_SUCCESS


def ping(bus):
    equal(bus.good(bus.sdk.ping(bus.port, LIGHT)), XM430_W350)
    equal(bus.good(bus.sdk.ping(bus.port, PHOTOMETER)), OUR_PHOTOMETER)
    equal(bus.sdk.ping(bus.port, 9)[1], COMM_RX_TIMEOUT, "nobody's id")


def broadcast_ping(bus):
    devices, result = bus.sdk.broadcastPing(bus.port)
    equal(result, COMM_SUCCESS)
    equal({id_: model for id_, (model, _) in devices.items()},
          {LIGHT: XM430_W350, SENSOR: XM430_W350, PHOTOMETER: OUR_PHOTOMETER})
    equal(list(devices), sorted(devices), "order of ids")


def read_and_write_every_width(bus):
    equal(bus.read(LIGHT, ID, 1), LIGHT)
    equal(bus.read(LIGHT, MODEL_NUMBER, 2), XM430_W350)
    equal(bus.read(LIGHT, PRESENT_POSITION, 4), 1536, "45 degrees below the normal")
    for address, length, value in [(LED, 1, 1), (POSITION_P_GAIN, 2, 640), (PROFILE_VELOCITY, 4, 100)]:
        bus.write(LIGHT, address, length, value)
        equal(bus.read(LIGHT, address, length), value, f"register {address}")


def refusals(bus):
    bus.write(LIGHT, PRESENT_POSITION, 4, 0, error=ACCESS)
    bus.write(LIGHT, LED, 1, 7, error=DATA_RANGE)
    bus.write(LIGHT, TORQUE_ENABLE, 1, 1)
    bus.write(LIGHT, OPERATING_MODE, 1, 4, error=ACCESS)
    bus.write(LIGHT, TORQUE_ENABLE, 1, 0)


def sync_write_and_read(bus):
    bus.sync_write(PROFILE_ACCELERATION, 4, {LIGHT: 9, SENSOR: 10})
    equal(bus.sync_read(PROFILE_ACCELERATION, 4, [SENSOR, LIGHT]), {SENSOR: 10, LIGHT: 9})


def bulk_write_and_read(bus):
    group = GroupBulkWrite(bus.port, bus.sdk)
    assert group.addParam(LIGHT, PROFILE_VELOCITY, 4, le(120))
    assert group.addParam(SENSOR, LED, 1, [1])
    equal(group.txPacket(), COMM_SUCCESS)
    wanted = {LIGHT: (PROFILE_VELOCITY, 4), SENSOR: (LED, 1), PHOTOMETER: (MODEL_NUMBER, 2)}
    values = {LIGHT: 120, SENSOR: 1, PHOTOMETER: OUR_PHOTOMETER}
    equal(bus.bulk_read(wanted), values)
    equal(bus.bulk_read(wanted, fast=True), values, "fast bulk read")


def fast_sync_read(bus):
    ids = [LIGHT, SENSOR]
    equal(bus.sync_read(PRESENT_POSITION, 4, ids, fast=True), bus.sync_read(PRESENT_POSITION, 4, ids))
    equal(bus.sync_read(MODEL_NUMBER, 2, [PHOTOMETER, LIGHT], fast=True),
          {PHOTOMETER: OUR_PHOTOMETER, LIGHT: XM430_W350})


def bytes_that_look_like_a_header(bus):
    for pattern in ([0xFF, 0xFF, 0xFD, 0x00], [0xFF, 0xFF, 0xFF, 0xFD], [0xFF] * 4 + [0xFD, 0xFF, 0xFF, 0xFF]):
        length = len(pattern)
        bus.good(bus.sdk.writeTxRx(bus.port, LIGHT, INDIRECT_DATA, length, pattern))
        equal(list(bus.good(bus.sdk.readTxRx(bus.port, LIGHT, INDIRECT_DATA, length))), pattern)


def reg_write_and_action(bus):
    bus.write(LIGHT, PROFILE_VELOCITY, 4, 30)
    bus.good(bus.sdk.regWriteTxRx(bus.port, LIGHT, PROFILE_VELOCITY, 4, le(31)))
    equal(bus.read(LIGHT, PROFILE_VELOCITY, 4), 30, "before the action")
    equal(bus.read(LIGHT, REGISTERED, 1), 1)
    # To all, since the SDK does not take the answer of a single one off the line.
    equal(bus.sdk.action(bus.port, BROADCAST_ID), COMM_SUCCESS)
    equal(bus.read(LIGHT, PROFILE_VELOCITY, 4), 31, "after the action")
    equal(bus.read(LIGHT, REGISTERED, 1), 0)


def a_move_arrives(bus):
    bus.sync_write(PROFILE_ACCELERATION, 4, {LIGHT: 10, SENSOR: 10})
    bus.sync_write(PROFILE_VELOCITY, 4, {LIGHT: 60, SENSOR: 60})
    bus.sync_write(TORQUE_ENABLE, 1, {LIGHT: 1, SENSOR: 1})
    begin = bus.sync_read(PRESENT_POSITION, 4, [LIGHT, SENSOR])
    goals = {LIGHT: 1300, SENSOR: 2900}
    bus.sync_write(GOAL_POSITION, 4, goals)
    equal(bus.sync_read(MOVING, 1, [LIGHT, SENSOR]), {LIGHT: 1, SENSOR: 1}, "moving")
    seen = set()

    def arrived():
        present = bus.sync_read(PRESENT_POSITION, 4, [LIGHT, SENSOR], fast=True)
        seen.add(present[LIGHT])
        return all(abs(present[id_] - goal) <= NEAR for id_, goal in goals.items())

    bus.until(arrived, "the move")
    bus.until(lambda: bus.read(LIGHT, MOVING, 1) == 0, "coming to rest")
    assert len(seen) > 10, f"{begin} to {goals} in {len(seen)} positions: no motion, a jump"
    equal(bus.read(LIGHT, MOVING_STATUS, 1) & 1, 1, "in-position bit")
    bus.sync_write(TORQUE_ENABLE, 1, {LIGHT: 0, SENSOR: 0})


def reboot_loses_ram(bus):
    bus.write(LIGHT, PROFILE_VELOCITY, 4, 77)
    bus.good(bus.sdk.reboot(bus.port, LIGHT))
    assert not bus.answers(LIGHT), "it answers while it boots"
    bus.wait(0.5)
    bus.until(lambda: bus.answers(LIGHT), "the boot")
    equal(bus.read(LIGHT, PROFILE_VELOCITY, 4), 0)


def clear_multi_turn(bus):
    bus.write(LIGHT, OPERATING_MODE, 1, 4)
    bus.write(LIGHT, PROFILE_VELOCITY, 4, 200)
    bus.write(LIGHT, TORQUE_ENABLE, 1, 1)
    bus.write(LIGHT, GOAL_POSITION, 4, 4096 + 500)
    bus.until(lambda: abs(bus.read(LIGHT, PRESENT_POSITION, 4) - 4596) <= NEAR, "the turn")
    bus.until(lambda: bus.read(LIGHT, MOVING, 1) == 0, "coming to rest")
    bus.good(bus.sdk.clearMultiTurn(bus.port, LIGHT))
    present = bus.read(LIGHT, PRESENT_POSITION, 4)
    assert abs(present - 500) <= NEAR, f"at {present} after the turns were cleared"
    bus.write(LIGHT, TORQUE_ENABLE, 1, 0)
    bus.write(LIGHT, OPERATING_MODE, 1, 3)


def another_id(bus):
    bus.write(SENSOR, ID, 1, 17)
    assert bus.answers(17) and not bus.answers(SENSOR)
    bus.write(17, ID, 1, SENSOR)
    assert bus.answers(SENSOR)


def status_return_level(bus):
    bus.write(SENSOR, STATUS_RETURN_LEVEL, 1, 1)
    equal(bus.sdk.write1ByteTxRx(bus.port, SENSOR, LED, 1)[0], COMM_RX_TIMEOUT, "a write at level 1")
    equal(bus.read(SENSOR, LED, 1), 1, "it was done all the same")
    bus.sdk.write1ByteTxOnly(bus.port, SENSOR, STATUS_RETURN_LEVEL, 2)
    bus.write(SENSOR, LED, 1, 0)


def wrong_baud_rate(bus):
    bus.port.setBaudRate(57_600)
    assert not bus.answers(LIGHT)
    bus.port.setBaudRate(BAUD)
    assert bus.answers(LIGHT)


def noise_before_a_packet(bus):
    for noise in ([0x00, 0x55], [0xFF, 0xFF, 0xFD], [0xFF, 0xFF, 0xFD, 0x00, 0x01, 0x40, 0x00, 0x03]):
        bus.port.writePort(noise)
        equal(bus.read(LIGHT, MODEL_NUMBER, 2), XM430_W350, f"after {noise}")


def photometer(bus):
    # Lamp on, one exposure of 1 ms, its sequence number and counts.
    bus.write(PHOTOMETER, LAMP_ENABLE, 1, 1)
    bus.wait(0.2)
    bus.good(bus.sdk.writeTxRx(bus.port, PHOTOMETER, INTEGRATION_TIME, 6, le(1000) + [0, 1]))
    bus.until(lambda: bus.read(PHOTOMETER, STATUS, 1) >= 2, "the exposure")
    equal(bus.read(PHOTOMETER, SEQUENCE, 4), 1, "sequence number")
    monitor = bus.read(PHOTOMETER, MONITOR, 4)
    assert monitor > 1000, f"the monitor sees {monitor} counts of the lamp"
    bus.write(PHOTOMETER, LAMP_ENABLE, 1, 0)


def factory_reset(bus):
    bus.write(SENSOR, RETURN_DELAY, 1, 5)
    bus.good(bus.sdk.factoryReset(bus.port, SENSOR, 0x02))
    bus.wait(0.5)
    bus.until(lambda: bus.answers(SENSOR), "the boot")
    equal(bus.read(SENSOR, RETURN_DELAY, 1), 250)


CHECKS = [
    ping,
    broadcast_ping,
    read_and_write_every_width,
    refusals,
    sync_write_and_read,
    bulk_write_and_read,
    fast_sync_read,
    bytes_that_look_like_a_header,
    reg_write_and_action,
    a_move_arrives,
    reboot_loses_ram,
    clear_multi_turn,
    another_id,
    status_return_level,
    wrong_baud_rate,
    noise_before_a_packet,
    photometer,
    factory_reset,
]


@contextlib.contextmanager
def simulator(binary, link, *options):
    process = subprocess.Popen([binary, "--link", link, *options], stdout=subprocess.PIPE,
                               stderr=subprocess.DEVNULL, text=True)
    try:
        path = process.stdout.readline().strip()
        equal(Path(link).readlink(), Path(path), "the link")
        yield link
    finally:
        process.send_signal(signal.SIGTERM)
        equal(process.wait(PATIENCE), 0, "exit code")
        assert not Path(link).is_symlink(), "the link is left"


def main():
    passed = failed = 0
    with tempfile.TemporaryDirectory() as directory:
        for options in ([], ["--wire-time"]):
            clock = "wire time" if options else "real time"
            with simulator(sys.argv[1], f"{directory}/bus", *options) as path:
                for check in CHECKS:
                    bus = Bus(path)
                    try:
                        check(bus)
                        passed += 1
                    except Exception:
                        failed += 1
                        print(f"FAILED in {clock}: {check.__name__}")
                        traceback.print_exc()
                    finally:
                        bus.port.closePort()
    print(f"sdk: {passed} passed, {failed} failed")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
