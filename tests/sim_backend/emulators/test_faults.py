"""Faults on request: each takes hold where it says, begins and ends on time, and is told."""

import json
import os
import random
from types import SimpleNamespace

import pytest

from drivers.codecs import stim300
from rig.config.bench import InjectedFault
from rig.errors import ConfigError
from sim_backend.emulators.faults.kinds import FAULTS
from sim_backend.emulators.faults.requests import FaultRequests
from sim_backend.emulators.faults.schedule import FaultSchedule

DATAGRAM = stim300.encode_datagram(stim300.Datagram(0x90, (0, 0, 1234), 0, 7, 506))
BENCH = SimpleNamespace(freeze_gyro=lambda frozen: None)


def acting(name, value=None, bench=BENCH):
    told = []
    faults = FaultSchedule([], lambda now_s, what: told.append((now_s, what)))
    faults.plan(InjectedFault(fault=name, after_s=1.0, lasts_s=2.0, value=value), 10.0)
    faults.pass_time(bench, 10.5)
    assert faults.gyro_bytes(DATAGRAM) == DATAGRAM, "not yet"
    faults.pass_time(bench, 11.0)
    return faults, told


def test_a_fault_begins_and_ends_on_time_and_both_are_told():
    faults, told = acting("gyro_silent")
    assert faults.gyro_bytes(DATAGRAM) == b""
    faults.pass_time(BENCH, 13.0)
    assert faults.gyro_bytes(DATAGRAM) == DATAGRAM
    assert told == [(11.0, "gyro_silent begins"), (13.0, "gyro_silent ends")]


def test_faults_of_the_file_count_from_the_moment_the_drive_is_enabled():
    faults = FaultSchedule([InjectedFault(fault="gyro_silent", after_s=0.5)], lambda now_s, what: None)
    faults.pass_time(BENCH, 1e6)
    assert faults.gyro_bytes(DATAGRAM) == DATAGRAM
    faults.enabled(20.0)
    faults.pass_time(BENCH, 20.5)
    assert faults.gyro_bytes(DATAGRAM) == b""


@pytest.mark.parametrize("name", ["gyro_checksum", "gyro_garbled"])
def test_a_spoiled_datagram_does_not_pass_for_a_sound_one(name):
    faults, _ = acting(name)
    matcher = stim300.datagram_matcher((0x90,), False)
    for _ in range(500):
        spoiled = faults.gyro_bytes(DATAGRAM)
        assert len(spoiled) == len(DATAGRAM)
        assert matcher(spoiled, 0) <= 0


def test_bytes_are_dropped_repeated_and_merged_as_asked():
    dropped, _ = acting("gyro_dropped", 0.25)
    kept = sum(bool(dropped.gyro_bytes(DATAGRAM)) for _ in range(4000))
    assert 2900 < kept < 3100
    repeated, _ = acting("gyro_repeated")
    assert repeated.gyro_bytes(DATAGRAM) == 2 * DATAGRAM
    merged, _ = acting("gyro_merged", 3)
    assert [merged.gyro_bytes(DATAGRAM) for _ in range(4)] == [b"", b"", 3 * DATAGRAM, b""]


def test_the_sensor_sticks_turns_round_comes_loose_and_jumps():
    values = {"gyro_stuck": 2.0, "gyro_reversed": -3.0, "gyro_loose": 0.0, "gyro_jump": 8.0}
    for name, expected in values.items():
        faults, _ = acting(name, 5.0)
        faults.rate(2.0)
        assert faults.rate(3.0) == expected


def test_the_bus_is_off_deaf_or_the_adapter_stalls():
    said = b"z\rt18142700F401\r"
    off, _ = acting("bus_off")
    assert off.to_adapter(b"t2014 0F000000\rt0800\r") == b"?\r?\r"
    deaf, _ = acting("bus_deaf")
    assert deaf.to_host(said) == b"z\r"
    stalled, _ = acting("adapter_stalls")
    assert (stalled.to_adapter(said), stalled.to_host(said)) == (b"", b"")


def test_the_shaft_feels_more_or_the_opposite_of_what_the_drive_makes():
    assert acting("torque_runs_away", 30.0)[0].torque(5.0) == 35.0
    assert acting("torque_reversed")[0].torque(5.0) == -5.0


def test_what_a_device_does_of_itself_is_done_once():
    done = []
    bench = SimpleNamespace(
        unplug_gyro=lambda: done.append("gyro"),
        unplug_adapter=lambda: done.append("adapter"),
        command_gyro=done.append,
        drive=SimpleNamespace(fail=lambda code, now_s: done.append(code), restart=done.append),
    )
    for name in ("gyro_unplugged", "adapter_unplugged", "gyro_restarts", "drive_fault", "drive_reset"):
        faults, _ = acting(name, bench=bench)
        faults.pass_time(bench, 12.0)
    assert done == ["gyro", "adapter", b"R\r", 0x4210, 11.0]


def test_an_unknown_fault_is_refused_with_those_there_are():
    with pytest.raises(ConfigError, match=r"no fault 'gremlins'; there are gyro_unplugged, .*torque_reversed"):
        FaultSchedule([InjectedFault(fault="gremlins")], lambda now_s, what: None)


def test_requests_come_as_lines_and_nonsense_is_refused_with_the_reason():
    reader, writer = os.pipe()
    taken, refused, now = [], [], [0.0]
    requests = FaultRequests(reader, taken.append, refused.append, lambda: now[0])
    os.write(writer, b'{"fault": "gyro_silent", "lasts_s": 0.2}\n{"fault": 3}\nnonsense\n{"fau')
    requests.poll()
    assert [f.fault for f in taken] == ["gyro_silent"]
    assert len(refused) == 2 and refused[0].startswith("fault: ")
    os.write(writer, b'lt": "bus_off"}\n')
    now[0] = 1.0
    requests.poll()
    assert taken[-1] == InjectedFault(fault="bus_off")
    os.close(writer)
    now[0] = 2.0
    requests.poll()
    requests.poll()
    os.close(reader)


def test_every_fault_says_what_it_is():
    assert all(fault.__doc__ and fault.__doc__.endswith(".") for fault in FAULTS.values())
    assert json.dumps(sorted(FAULTS)) and len({id(f) for f in FAULTS.values()}) == len(FAULTS)
    assert all(FAULTS[name](None, random.Random(1)).torque(1.0) is not None for name in FAULTS)
