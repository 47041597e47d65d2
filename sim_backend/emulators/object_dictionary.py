"""The object dictionary of an emulated CANopen device and the SDO server in front of it (CiA 301)."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import canopen
from canopen.objectdictionary import ODVariable

ABORT_TOGGLE = 0x05030000
ABORT_COMMAND = 0x05040001
ABORT_WRITE_ONLY, ABORT_READ_ONLY = 0x06010001, 0x06010002
ABORT_NO_OBJECT, ABORT_NO_SUBINDEX = 0x06020000, 0x06090011
ABORT_LENGTH = 0x06070010
ABORT_VALUE = 0x06090030
ABORT_STATE = 0x08000022


class SdoAbort(Exception):
    """A refusal with its abort code."""

    def __init__(self, code: int) -> None:
        super().__init__(f"0x{code:08X}")
        self.code = code


class ObjectDictionary:
    """Values of a device, with defaults, types and access rights of its EDS.

    ``before_write[index]`` may refuse (raise SdoAbort) or act on a write: called with (subindex, bytes).
    """

    def __init__(self, eds: Path, node: int) -> None:
        self._od = canopen.import_od(str(eds), node_id=node)
        self._values: dict[tuple[int, int], bytes] = {}
        self._numbers: dict[tuple[int, int], int] = {}  # decoded values: a PDO looks up twenty a millisecond
        self.before_write: dict[int, Callable[[int, bytes], None]] = {}

    def variable(self, index: int, subindex: int) -> ODVariable:
        """The description of one entry; SdoAbort if there is none."""
        if index not in self._od:
            raise SdoAbort(ABORT_NO_OBJECT)
        entry = self._od[index]
        if isinstance(entry, ODVariable):
            if subindex:
                raise SdoAbort(ABORT_NO_SUBINDEX)
            return entry
        if subindex not in entry.subindices:
            raise SdoAbort(ABORT_NO_SUBINDEX)
        found = entry[subindex]
        assert isinstance(found, ODVariable)
        return found

    def get(self, index: int, subindex: int = 0) -> int:
        """Present value of a number."""
        number = self._numbers.get((index, subindex))
        if number is None:
            number = int(self.variable(index, subindex).decode_raw(self.read(index, subindex)))
            self._numbers[index, subindex] = number
        return number

    def set(self, index: int, value: int, subindex: int = 0) -> None:
        """Set a number from inside the device, whatever its access rights."""
        self._values[index, subindex] = bytes(self.variable(index, subindex).encode_raw(value))
        self._numbers[index, subindex] = value

    def read(self, index: int, subindex: int) -> bytes:
        """Bytes as they go over the wire."""
        stored = self._values.get((index, subindex))
        if stored is not None:
            return stored
        variable = self.variable(index, subindex)
        return bytes(variable.encode_raw(0 if variable.default is None else variable.default))

    def write(self, index: int, subindex: int, data: bytes) -> None:
        """A write from outside. Raises SdoAbort where it is refused."""
        variable = self.variable(index, subindex)
        if not variable.writable:
            raise SdoAbort(ABORT_READ_ONLY)
        size = len(variable) // 8
        if len(data) < size:
            raise SdoAbort(ABORT_LENGTH)
        data = data[:size]
        if index in self.before_write:
            self.before_write[index](subindex, data)
        self._values[index, subindex] = data
        self._numbers.pop((index, subindex), None)


class SdoServer:
    """Answers SDO requests: expedited transfers both ways and segmented upload (names, EDS text)."""

    def __init__(self, dictionary: ObjectDictionary) -> None:
        self._dictionary = dictionary
        self._left = b""
        self._toggle = 0

    def answer(self, request: bytes) -> bytes:
        """The eight bytes of the answer to the eight bytes of a request."""
        request = request.ljust(8, b"\0")
        index, subindex = int.from_bytes(request[1:3], "little"), request[3]
        try:
            command = request[0] >> 5
            if command == 1:
                return self._download(request, index, subindex)
            if command == 2:
                return self._upload(index, subindex)
            if command == 3:
                return self._upload_segment(request)
            raise SdoAbort(ABORT_COMMAND)
        except SdoAbort as refusal:
            return b"\x80" + request[1:4] + refusal.code.to_bytes(4, "little")

    def _download(self, request: bytes, index: int, subindex: int) -> bytes:
        if not request[0] & 0b10:
            raise SdoAbort(ABORT_COMMAND)  # segmented download: nothing here is longer than four bytes
        size = 4 - (request[0] >> 2 & 3) if request[0] & 1 else 4
        self._dictionary.write(index, subindex, request[4 : 4 + size])
        return b"\x60" + request[1:4] + bytes(4)

    def _upload(self, index: int, subindex: int) -> bytes:
        head = index.to_bytes(2, "little") + bytes([subindex])
        data = self._dictionary.read(index, subindex)
        if 0 < len(data) <= 4:
            return bytes([0x43 | (4 - len(data)) << 2]) + head + data.ljust(4, b"\0")
        self._left, self._toggle = data, 0
        return b"\x41" + head + len(data).to_bytes(4, "little")

    def _upload_segment(self, request: bytes) -> bytes:
        if request[0] >> 4 & 1 != self._toggle:
            raise SdoAbort(ABORT_TOGGLE)
        part, self._left = self._left[:7], self._left[7:]
        head = self._toggle << 4 | (7 - len(part)) << 1 | (not self._left)
        self._toggle ^= 1
        return bytes([head]) + part.ljust(7, b"\0")
