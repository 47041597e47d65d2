import re
import struct

import pytest

from drivers.codecs import cia402, lawicel, odrive_cansimple
from drivers.codecs.lawicel import Answer, CanFrame
from tests.drivers.wire import WIRE, needs_captures, vectors

SLCAN = vectors("slcan")
CIA402_LOG = vectors("CANopen CiA402")


@pytest.mark.parametrize("vector", SLCAN, ids=[v["id"] for v in SLCAN])
def test_slcan_line_decodes_to_its_stored_values(vector):
    raw, want = bytes.fromhex(vector["hex"]), vector["decoded"]
    [got] = lawicel.LawicelDecoder().feed(raw)
    if isinstance(got, Answer):
        want_text = want.get("serial") or f"{want['hw']}{want['sw']}"
        assert got == Answer(raw[:1].decode(), want_text)
        return
    assert got.identifier == want["id"]
    assert got.extended == want.get("ext", False)
    assert got.remote == want.get("rtr", False)
    assert got.data.hex() == want.get("data", got.data.hex())
    assert len(got.data) + got.length * got.remote == want.get("dlc", len(got.data))
    if not got.fd:
        assert lawicel.encode_frame(got) == raw


def test_lawicel_answers_and_frames_in_one_read():
    decoder = lawicel.LawicelDecoder()
    got = decoder.feed(b"\rz\r\aV1013\rt10021122ABCD\rt1")
    assert got == [
        Answer("ok"),
        Answer("sent"),
        Answer("error"),
        Answer("V", "1013"),
        CanFrame(0x100, b"\x11\x22", length=2, timestamp_ms=0xABCD),
    ]
    assert decoder.feed(b"230\r") == [CanFrame(0x123, b"")]
    assert decoder.dropped_lines == 0


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        (b"t12391122", "length above 8"),
        (b"t1232112", "not a frame"),
        (b"t123211", "frame cut or run together"),
        (b"t12321122t1230", "frame cut or run together"),
        (b"tFFF0", "identifier out of range"),
        (b"?!", "neither frame nor answer"),
    ],
)
def test_lawicel_line_that_is_no_frame_is_dropped_with_the_reason(line, reason):
    decoder = lawicel.LawicelDecoder()
    assert decoder.feed(line + b"\rt1230\r") == [CanFrame(0x123, b"")]
    assert decoder.dropped == [(line, reason)]


def test_lawicel_garbage_without_line_end_costs_no_memory():
    decoder = lawicel.LawicelDecoder()
    for _ in range(100):
        decoder.feed(b"x" * 100)
    assert len(decoder._rest) <= 160
    assert len(decoder.dropped) <= 16


def test_lawicel_flags_in_words():
    assert lawicel.flags_in_words("00") == ""
    assert lawicel.flags_in_words("A2") == "transmit queue full, error passive, bus error"


@needs_captures
def test_odrive_commands_are_those_of_the_makers_dbc():
    text = (WIRE / "eds" / "odrive_cansimple.dbc").read_text()
    published = {int(number) for number in re.findall(r"^BO_ (\d+) Axis0_", text, re.MULTILINE)}
    ours = {int(c) for c in odrive_cansimple.Command} - {odrive_cansimple.Command.ESTOP}
    assert ours <= published, "every command but ESTOP (a frame without payload) stands in the file"
    states = dict(re.findall(r"(\d+) \"(\w+)\"", re.search(r"VAL_ 1 Axis_State (.*);", text)[1]))
    assert states[str(odrive_cansimple.AXIS_CLOSED_LOOP)] == "CLOSED_LOOP_CONTROL"
    modes = dict(re.findall(r"(\d+) \"(\w+)\"", re.search(r"VAL_ 11 Control_Mode (.*);", text)[1]))
    assert modes[str(odrive_cansimple.CONTROL_TORQUE)] == "TORQUE_CONTROL"
    inputs = dict(re.findall(r"(\d+) \"(\w+)\"", re.search(r"VAL_ 11 Input_Mode (.*);", text)[1]))
    assert inputs[str(odrive_cansimple.INPUT_PASSTHROUGH)] == "PASSTHROUGH"
    errors = re.findall(r"(\d+) \"\w+\"", re.search(r"VAL_ 1 Axis_Error (.*);", text)[1])
    assert set(map(int, errors)) - {0} == set(odrive_cansimple.AXIS_ERRORS)


def test_odrive_torque_and_heartbeat_round_trip():
    command = odrive_cansimple.Command
    assert odrive_cansimple.identifier(3, command.SET_INPUT_TORQUE) == 0x6E
    assert odrive_cansimple.split(0x6E) == (3, 0x0E)
    assert odrive_cansimple.encode(command.SET_INPUT_TORQUE, 1.5) == struct.pack("<f", 1.5)
    beat = odrive_cansimple.decode_heartbeat(odrive_cansimple.encode(command.HEARTBEAT, 0x800, 1, 0, 0, 0))
    assert odrive_cansimple.errors_in_words(beat.axis_error) == "watchdog timer expired"
    with pytest.raises(ValueError, match="payload"):
        odrive_cansimple.decode(command.GET_IQ, b"\0\0")


@pytest.mark.parametrize(
    "vector",
    [v for v in CIA402_LOG if "statusword" in v["decoded"]["meaning"]],
    ids=lambda v: v["id"],
)
def test_statusword_of_a_real_bus_log_gives_the_state_named_there(vector):
    state = cia402.state_of(int.from_bytes(bytes.fromhex(vector["hex"]), "little"))
    assert state.value.upper() in vector["decoded"]["meaning"]


def test_every_state_has_its_statusword():
    for state in cia402.State:
        assert cia402.state_of(cia402.statusword_of(state)) is state
    assert cia402.state_of(0x0013) is None


def test_emergency_in_words():
    code, register, _ = cia402.decode_emergency(cia402.encode_emergency(0x8130, 0x11))
    assert (code, register) == (0x8130, 0x11)
    assert "no longer hears this computer" in cia402.emergency_in_words(code)
    assert cia402.emergency_in_words(0x7399) == "sensor"
    assert cia402.emergency_in_words(0x4290) == "device temperature"
    assert cia402.emergency_in_words(0xF123) == "additional functions"
    with pytest.raises(ValueError, match="at least 3"):
        cia402.decode_emergency(b"\x01")
