"""CAN under hostile frames: the Lawicel line, ODrive, moteus, VESC, CiA 402; and the clocks of the devices."""

from __future__ import annotations

import math
import struct

import numpy as np

from benchmarks.fuzz import checksums
from drivers.amplifiers import make_amplifier
from drivers.amplifiers.base import Amplifier
from drivers.amplifiers.cia402_status import DriveStatus
from drivers.amplifiers.moteus import decode_registers
from drivers.amplifiers.torque_clock import TorqueClock
from drivers.amplifiers.vesc import decode_status
from drivers.capture.wire_capture import pack_frame, unpack_frame
from drivers.codecs import cia402, lawicel, odrive_cansimple
from drivers.codecs.lawicel import CanFrame, LawicelDecoder
from drivers.gyroscopes import make_gyroscope
from drivers.timing.retiming import MAX_CORRECTION_S
from drivers.timing.source_clock import SourceClock
from drivers.transport.can_link import ReceivedFrame
from rig.config.bench import AmplifierConfig, CanConfig, GyroscopeConfig
from rig.errors import DeviceFault

HEX = frozenset(b"0123456789abcdefABCDEF")
LONGEST_LINE = 160
FD_LENGTHS = frozenset((*range(9), 12, 16, 20, 24, 32, 48, 64))
MOST_EMERGENCIES = 10_000
ANOTHER_SET = 77
DRIVE_TICK, GYRO_TICK = 218, 18  # 10 ms more on either clock, and settled


def lawicel_stream(data: bytes) -> int:
    """The line of an adapter: frames within what CAN allows, the same however it is read, memory bounded."""
    decoder = LawicelDecoder()
    items = decoder.feed(data)
    assert len(decoder._rest) <= LONGEST_LINE
    assert len(decoder.dropped) <= 16
    step = 1 + len(data) % 13
    again = LawicelDecoder()
    cut = [item for at in range(0, len(data), step) for item in again.feed(data[at : at + step])]
    if not again.dropped_lines and not decoder.dropped_lines:
        assert cut == items, "the frames depend on how the line is cut into reads"
    for item in items:
        if isinstance(item, CanFrame):
            _check_frame(item)
        elif item.kind == "F":
            str(lawicel.flags_in_words(item.text))
    _no_frame_out_of_nothing(data, items)
    return len(data)


def _check_frame(frame: CanFrame) -> None:
    assert 0 <= frame.identifier <= (0x1FFFFFFF if frame.extended else 0x7FF), frame
    assert -1 <= frame.timestamp_ms <= 0xFFFF, frame
    assert len(frame.data) in FD_LENGTHS if frame.fd else len(frame.data) <= 8, frame
    kept = unpack_frame(pack_frame(frame))
    assert (kept.identifier, kept.data, kept.extended, kept.remote, kept.fd) == (
        frame.identifier, frame.data, frame.extended, frame.remote, frame.fd,
    ), frame  # fmt: skip
    if not frame.fd:
        assert lawicel.decode_line(lawicel.encode_frame(frame)[:-1]) == frame, frame


def _no_frame_out_of_nothing(data: bytes, items: list[object]) -> None:
    """As many frames as there are lines made of hexadecimal digits alone."""
    lines = data.replace(b"\a", b"\a\r").split(b"\r")
    could_be = sum(len(line) > 4 and line[0] in b"tTrRdDbB" and HEX.issuperset(line[1:]) for line in lines)
    assert sum(isinstance(item, CanFrame) for item in items) <= could_be, data


def frames_of(data: bytes) -> list[CanFrame]:
    """An input as frames: identifier by a choice or at random, length, data."""
    frames, at = [], 0
    while at + 4 <= len(data):
        flags, number, node, length = data[at : at + 4]
        length %= 65 if flags & 4 else 9
        extended = bool(flags & 1)
        identifier = number << 8 | node if flags & 1 else (number << 3 ^ node) & 0x7FF
        body = data[at + 4 : at + 4 + length]
        frames.append(CanFrame(identifier, body, extended, bool(flags & 2), len(body), -1, bool(flags & 4)))
        at += 4 + length
    return frames


def _drive(amplifier: Amplifier, data: bytes) -> None:
    for k, frame in enumerate(frames_of(data)):
        amplifier.receive(ReceivedFrame(k * 1e-3, frame))
        actual = amplifier.actual_torque_nm
        assert actual is None or isinstance(actual, float)
        try:
            amplifier.check(k * 1e-3)
        except DeviceFault:
            continue


def odrive_frames(data: bytes) -> int:
    """Every command with every payload, and the driver that hears them."""
    for frame in frames_of(data):
        try:
            values = odrive_cansimple.decode(frame.identifier & 0x1F, frame.data)
        except ValueError:
            continue
        assert all(isinstance(value, (int, float)) for value in values)
        if frame.identifier & 0x1F == 1:
            beat = odrive_cansimple.decode_heartbeat(frame.data)
            assert isinstance(odrive_cansimple.errors_in_words(beat.axis_error), str)
    _drive(make_amplifier(AmplifierConfig(device="odrive", node=1)), data)
    return len(data)


def moteus_frames(data: bytes) -> int:
    """Register replies of any kind, and the driver that hears them."""
    for start in range(0, len(data), 64):
        reply = data[start : start + 64]
        try:
            registers = decode_registers(reply)
        except ValueError:
            continue
        assert len(registers) <= 64
    config = AmplifierConfig(device="moteus", node=1, can=CanConfig(interface="socketcan"))
    _drive(make_amplifier(config), data)
    return len(data)


def vesc_frames(data: bytes) -> int:
    """Status frames, and the driver that hears them."""
    for frame in frames_of(data):
        try:
            values = decode_status(frame.data)
        except ValueError:
            assert len(frame.data) != 8
            continue
        assert all(math.isfinite(value) for value in values)
    settings = {"torque_constant_nm_a": 0.1, "peak_current_a": 50.0, "timeout_is_set": True}
    _drive(make_amplifier(AmplifierConfig(device="vesc", node=1, settings=settings)), data)
    return len(data)


def cia402_frames(data: bytes) -> int:
    """Status words, emergencies, heartbeats, and the status that is kept of them."""
    status = DriveStatus(1, 0.1, "drive")
    status.begin(0.0)
    for k, frame in enumerate(frames_of(data)):
        rest = status.receive(ReceivedFrame(k * 1e-3, frame))
        assert rest is None or rest == frame.data[2:]
        if len(frame.data) >= 2:
            word = int.from_bytes(frame.data[:2], "little")
            state = cia402.state_of(word)
            assert state is None or cia402.state_of(cia402.statusword_of(state)) is state
            assert cia402.emergency_in_words(word)
        try:
            code, register, maker = cia402.decode_emergency(frame.data)
        except ValueError:
            assert len(frame.data) < 3
        else:
            assert code == struct.unpack("<H", frame.data[:2])[0] and register == frame.data[2] and len(maker) <= 5
        try:
            status.check(k * 1e-3)
        except DeviceFault:
            continue
    assert len(status.emergencies) <= MOST_EMERGENCIES
    _drive(make_amplifier(AmplifierConfig(device="cia402", node=1)), data)
    return len(data)


def clocks(data: bytes) -> int:
    """Counters that jump, run backwards or stand still, at times that do the same: every time stays a number.

    What is said of the times in clock is in order and near what was recorded.
    """
    source, torque = SourceClock(1e-3), TorqueClock(1e-6, 1 << 32)
    gyro = make_gyroscope(GyroscopeConfig(sample_rate_hz=2000))
    both = (torque.retiming, gyro.retiming)
    count, now_s, at = 0, 100.0, 0
    for clock in both:
        clock.begin_set(now_s)
    while at + 8 <= len(data):
        kind, counter, latency, step, wait = struct.unpack_from("<BBHhh", data, at)
        at += 8
        scale = 10.0 ** (kind % 8 - 5)
        now_s = min(max(now_s + wait * scale, 0.0), 1e9)
        count = min(max(count + (step << kind % 24), -(1 << 62)), 1 << 62)
        if kind & 16:
            for clock in both:
                clock.end_tick()
        if counter == ANOTHER_SET:
            for clock in both:
                clock.end_set()
                clock.begin_set(now_s)
        if kind & 32:
            source.observe(count, now_s)
            assert math.isfinite(source.host_time_s(count)), "the device's clock was lost"
            assert abs(source.drift_ppm) <= 1000.0 + 1e-6
            continue
        if kind & 64:
            if kind & 128:
                torque.asked(now_s)
            assert math.isfinite(torque.received(count & 0xFFFFFFFF, now_s))
            continue
        body = b"\x90" + bytes(10) + bytes([counter]) + latency.to_bytes(2, "big")
        for sample in gyro.feed(body + checksums.stim300_crc(body).to_bytes(4, "big"), now_s):
            assert math.isfinite(sample.time_s)
    for clock in both:
        clock.end_tick()
        clock.end_set()
        for one in clock.retimed_sets():
            assert len(one.recorded_s) == len(one.refined_s) > 0
            assert np.all(np.diff(one.recorded_s) > 0.0) and np.all(np.diff(one.refined_s) > 0.0), "times out of order"
            assert np.max(np.abs(one.refined_s - one.recorded_s)) <= MAX_CORRECTION_S + 1e-9, "too far"
    return len(data)


def regular_clocks() -> list[bytes]:
    """Inputs of ``clocks`` in which nothing is wrong: four seconds of a drive's stamps, and of a gyro's samples."""
    drive = b"".join(struct.pack("<BBHhh", DRIVE_TICK, 0, 0, 2500, 10) for _ in range(400))
    gyro = b"".join(struct.pack("<BBHhh", GYRO_TICK, 20 * k & 255, 300, 1, 10) for k in range(400))
    return [drive, gyro]
