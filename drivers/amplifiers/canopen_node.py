"""CANopen without threads: the `canopen` library's SDO client, PDO maps and NMT over a polled link."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Any

import canopen
from canopen.sdo import SdoAbortedError, SdoClient, SdoCommunicationError

from drivers.codecs.lawicel import CanFrame
from drivers.transport.can_link import CanLink, ReceivedFrame
from drivers.transport.ports import MAX_QUOTED
from rig.errors import ConfigError, DeviceFault

MAX_EDS_BYTES = 4 << 20  # the largest of the trade have one

# What the library logs is said by our own faults; without a handler it would go to the operator's terminal.
logging.getLogger("canopen").addHandler(logging.NullHandler())


class PolledSdoClient(SdoClient):
    """Waits for an answer by polling the link, instead of for a background thread that fills a queue."""

    link: CanLink

    def read_response(self) -> bytes:
        """The next answer of the server. Raises SdoCommunicationError after the timeout."""
        if not self.link.wait(self.RESPONSE_TIMEOUT, lambda: not self.responses.empty()):
            raise SdoCommunicationError("No SDO response received")
        return bytes(super().read_response())


class PolledNode(canopen.RemoteNode):
    """A remote node whose SDO client polls."""

    def add_sdo(self, rx_cobid: int, tx_cobid: int) -> PolledSdoClient:
        """As in the library, with the polling client."""
        client = PolledSdoClient(rx_cobid, tx_cobid, self.object_dictionary)
        self.sdo_channels.append(client)
        return client


class PolledNetwork(canopen.Network):
    """The library's network on a link of ours."""

    def __init__(self, link: CanLink) -> None:
        super().__init__()
        self._link = link
        link.listeners.append(self._hear)

    def _hear(self, heard: ReceivedFrame) -> None:
        frame = heard.frame
        if not frame.remote and not frame.extended:
            self.notify(frame.identifier, bytearray(frame.data), heard.time_s)

    def send_message(self, can_id: int, data: bytes, remote: bool = False) -> None:
        """Send through the link."""
        self._link.send([CanFrame(can_id, bytes(data), remote=remote, length=len(data))])


def read_dictionary(path: Path, node: int) -> canopen.ObjectDictionary:
    """Object dictionary from an EDS or DCF file.

    Raises
    ------
    ConfigError
        If the file is missing or not an EDS.
    """
    try:
        if not path.exists():
            raise ConfigError(f"bench.amplifier.settings.eds: there is no file {path}")
        if not path.is_file() or path.stat().st_size > MAX_EDS_BYTES:
            raise ConfigError(
                f"bench.amplifier.settings.eds: {path} is not a regular file of at most {MAX_EDS_BYTES >> 20} MiB: "
                "give the EDS or DCF of the drive's maker"
            )
        return canopen.import_od(str(path), node_id=node)
    except ConfigError:
        raise
    except Exception as problem:  # noqa: BLE001  the library lets parser errors of any kind through
        why = " ".join(str(problem).split())  # it quotes the line, and a file that is no EDS may be a single one
        why = why if len(why) <= MAX_QUOTED else f"{why[:MAX_QUOTED]} ..."
        raise ConfigError(f"bench.amplifier.settings.eds: {path} cannot be read as EDS: {why}") from None


class RemoteObjects:
    """SDO access with messages that name the drive, the object and the cure."""

    def __init__(
        self, link: CanLink, node: int, dictionary: canopen.ObjectDictionary, timeout_s: float, label: str
    ) -> None:
        self.label = label
        self.node = node
        self.network = PolledNetwork(link)
        self.remote = PolledNode(node, dictionary)
        for client in self.remote.sdo_channels:
            client.link = link
            client.RESPONSE_TIMEOUT = timeout_s
            client.MAX_RETRIES = 2
        self.network.add_node(self.remote)
        self._timeout_s = timeout_s

    def read(self, index: int, subindex: int = 0, signed: bool = False) -> int:
        """A number. Raises DeviceFault if the drive refuses or does not answer."""
        return int.from_bytes(self._guarded("read", index, subindex, self._upload), "little", signed=signed)

    def read_if_there(self, index: int, subindex: int = 0, signed: bool = False) -> int | None:
        """A number, or None where the drive has no such object."""
        try:
            return int.from_bytes(self._upload(index, subindex), "little", signed=signed)
        except SdoAbortedError:
            return None
        except SdoCommunicationError:
            raise self._silent(index, subindex) from None

    def write(self, index: int, subindex: int, value: int, size: int) -> None:
        """Write a number of ``size`` bytes. Raises DeviceFault if the drive refuses or does not answer."""
        data = (value & (1 << 8 * size) - 1).to_bytes(size, "little")
        self._guarded("write", index, subindex, lambda i, s: self.remote.sdo.download(i, s, data))

    def _upload(self, index: int, subindex: int) -> bytes:
        return bytes(self.remote.sdo.upload(index, subindex))

    def _guarded(self, verb: str, index: int, subindex: int, action: Any) -> Any:
        try:
            return action(index, subindex)
        except SdoAbortedError as refusal:
            raise DeviceFault(f"{self.label} refuses to {verb} 0x{index:04X}:{subindex:02X}: {refusal}") from None
        except SdoCommunicationError:
            raise self._silent(index, subindex) from None

    def _silent(self, index: int, subindex: int) -> DeviceFault:
        return DeviceFault(
            f"{self.label} does not answer (SDO 0x{index:04X}:{subindex:02X}, {self._timeout_s:g} s): check "
            "its supply, node number, CAN bit rate and termination"
        )

    def save_pdo(self, pdo: Any, what: str) -> None:
        """Write a PDO map to the drive. Raises DeviceFault with what was refused."""
        try:
            pdo.save()
        except SdoAbortedError as refusal:
            raise DeviceFault(f"{self.label} refuses the mapping of {what}: {refusal}") from None
        except SdoCommunicationError:
            raise DeviceFault(
                f"{self.label} stopped answering while {what} was mapped: check its supply and the CAN cable"
            ) from None
