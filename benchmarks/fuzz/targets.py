"""Everything that bytes of the wire reach, by name. A further target is a function and a line here."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from benchmarks.fuzz import can_targets, gyro_targets

Target = Callable[[bytes], int]
"""Takes an input, raises where a promise is broken, returns how many bytes went through the codec."""

TARGETS: Mapping[str, Target] = {
    "stim300": gyro_targets.stim300_stream,
    "stim300_text": gyro_targets.stim300_text,
    "vectornav": gyro_targets.vectornav_stream,
    "kvh1750": gyro_targets.kvh_stream,
    "xbus": gyro_targets.xbus_stream,
    "lawicel": can_targets.lawicel_stream,
    "odrive": can_targets.odrive_frames,
    "moteus": can_targets.moteus_frames,
    "vesc": can_targets.vesc_frames,
    "cia402": can_targets.cia402_frames,
    "clocks": can_targets.clocks,
}


def seeds(name: str) -> list[bytes]:
    """A few inputs that reach deep: pieces with a right checksum, lines and frames as devices send them."""
    sealed = b"".join(bytes([kind, 40]) + bytes(range(k, k + 40)) for k, kind in enumerate((1, 2, 129, 130, 3, 4, 131)))
    own = {
        "stim300": [bytes([head, ending]) + sealed for head in range(24) for ending in (0, 1)],
        "stim300_text": [b"isn,28\r#isn,0,28\rd 3,1\rE007 TOO LONG\r>\rSYSTEM RETURNING TO NORMAL\r"],
        "vectornav": [sealed, b"\x01\x20YMR,1.0,2,3,4,5,6,7,8,9,+01.0,-2,3\x01\x06ERR,12\x02\x05RRG,1"],
        "lawicel": [b"\r\a", b"z\rZ\rF20\rV1013\rt1812AABB\rT0000018F8AABBCCDDEEFF0011\rr1230\rR000001238\r"
                    b"t12310012AB\rd1239" + b"0" * 24 + b"\r", b"t" * 300],
        "clocks": can_targets.regular_clocks(),
    }  # fmt: skip
    frames = b"".join(bytes([0, n >> 3, n & 7 | 1, 8]) + bytes(range(8)) for n in (0x81, 0x181, 0x701, 0x21, 0x34))
    moteus = bytes([5, 1, 0, 16]) + bytes.fromhex("2400010a2c0d00000000002500000f00")
    return [*own.get(name, [sealed]), frames, moteus + frames, bytes(range(256))]
