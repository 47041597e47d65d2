"""Own slcan bus against python-can's on the same pseudo terminal: frames a second and CPU a frame, one run.

    python -m benchmarks.slcan_bus [--frames 20000] [--rounds 5]

A child process plays the adapter: it answers commands and, told to, writes frames as fast as they are
taken. Both buses receive the same frames in alternation; ratios within a round cancel what else the
machine is doing.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import statistics
import time
from collections.abc import Callable
from typing import Any

import can
from can.interfaces.slcan import slcanBus

from drivers.codecs.lawicel import CanFrame, encode_frame
from drivers.transport.slcan import SlcanBulkBus
from sim_backend.emulators.adapter import LawicelAdapter
from sim_backend.emulators.pty_port import PtyPort

START = 0x7F0
CHUNK = 100


def play_adapter(ports: Any, frames: int) -> None:
    """Answer like an adapter; a frame with the identifier START calls for the flood."""
    port = PtyPort()
    asked = []
    adapter = LawicelAdapter(lambda frame: asked.append(frame.identifier))
    ports.send(port.path)
    flood = [
        b"".join(encode_frame(CanFrame(0x181, (k + i).to_bytes(8, "little"))) for i in range(CHUNK))
        for k in range(0, frames, CHUNK)
    ]
    os.set_blocking(port.fileno(), True)
    while True:
        answer = adapter.feed(os.read(port.fileno(), 4096))
        os.write(port.fileno(), answer)
        if asked and asked.pop() == START:
            for chunk in flood:
                view = memoryview(chunk)
                while view:
                    view = view[os.write(port.fileno(), view) :]


def measure(open_bus: Callable[[], can.BusABC], frames: int) -> tuple[float, float]:
    """(frames a second, CPU microseconds a frame) of one bus receiving the flood."""
    bus = open_bus()
    try:
        begin, cpu = time.perf_counter(), time.process_time()
        bus.send(can.Message(arbitration_id=START, is_extended_id=False))
        for k in range(frames):
            message = bus.recv(5.0)
            assert message is not None, f"frame {k} of {frames} did not arrive"
        return frames / (time.perf_counter() - begin), (time.process_time() - cpu) / frames * 1e6
    finally:
        bus.shutdown()


def main() -> None:
    """Print a line a round and the medians."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--frames", type=int, default=20_000)
    parser.add_argument("--rounds", type=int, default=5)
    arguments = parser.parse_args()
    here, there = multiprocessing.Pipe()
    adapter = multiprocessing.Process(target=play_adapter, args=(there, arguments.frames), daemon=True)
    adapter.start()
    path = here.recv()
    buses: dict[str, Callable[[], can.BusABC]] = {
        "slcan (python-can)": lambda: slcanBus(path, bitrate=1_000_000, sleep_after_open=0.1),
        "slcan_bulk (own)": lambda: SlcanBulkBus(path, bitrate=1_000_000),
    }
    results: dict[str, list[tuple[float, float]]] = {name: [] for name in buses}
    for number in range(arguments.rounds):
        for name, open_bus in buses.items():
            results[name].append(measure(open_bus, arguments.frames))
            rate, cpu = results[name][-1]
            print(f"round {number + 1}  {name:20s} {rate:9.0f} frames/s  {cpu:7.2f} us CPU a frame", flush=True)
    adapter.terminate()
    stock, own = (list(zip(*results[name], strict=True)) for name in buses)
    faster = [b / a for a, b in zip(stock[0], own[0], strict=True)]
    cheaper = [a / b for a, b in zip(stock[1], own[1], strict=True)]
    print(
        f"own bus: {statistics.median(faster):.1f} times the frames a second "
        f"({min(faster):.1f} to {max(faster):.1f}), CPU a frame 1/{statistics.median(cheaper):.1f} "
        f"({min(cheaper):.1f} to {max(cheaper):.1f})"
    )


if __name__ == "__main__":
    main()
