"""The backends that a campaign can be played on: a name and a factory each, nothing heavy until one is called."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rig.clock import Clock, HostClock, VirtualClock
from rig.config.load import LoadedConfig
from rig.config.root import Config
from rig.errors import ConfigError, UsageError
from rig.interface import Rig, Torque

if TYPE_CHECKING:
    from drivers.bench import BenchRig
    from rig.config.bench import BenchConfig

RECORDED = "recorded"
EMULATED = "emulated"
SIMULATED = "simulated"
BENCH_CHANNELS = ("drive_torque_nm", "sent_torque_nm")  # further channels of a bench whose drive reports its torque


def no_device_report() -> dict[str, Any]:
    """Of a rig that has nothing to tell about itself."""
    return {}


@dataclass(frozen=True)
class Stage:
    """A rig to play on, the clock that its samples are stamped by, and what it can tell afterwards.

    ``account`` goes into recording.h5 and, as text, to `rig check`.
    """

    rig: Rig
    clock: Clock
    account: Callable[[], dict[str, Any]] = no_device_report


Backend = Callable[[LoadedConfig, Path], AbstractContextManager[Stage]]


@contextmanager
def simulated(loaded: LoadedConfig, raw_folder: Path) -> Iterator[Stage]:
    """The rig made of equations, in time that jumps."""
    from sim_backend.simulated import SimulatedRig

    config = loaded.config
    channels = {**config.model.platform().channels, **config.simulated.platform.platform().channels}
    rig = SimulatedRig(config.simulated, config.excitation.sample_rate_hz, channels=channels.values())
    yield Stage(rig, VirtualClock())


@contextmanager
def bench(loaded: LoadedConfig, raw_folder: Path) -> Iterator[Stage]:
    """Real devices, or the raw capture of a campaign that was played on them."""
    section = _bench_section(loaded.config)
    _require_channels(loaded.config)
    if section.replay is not None:
        yield _replayed(_capture_of(loaded.folder, section.replay), section)
        return
    yield _bench_stage(section, Torque.REAL, raw_folder)


@contextmanager
def emulated(loaded: LoadedConfig, raw_folder: Path) -> Iterator[Stage]:
    """The same drivers on devices that are emulated at wire level in a process of their own."""
    config = loaded.config
    _require_channels(config)
    if _bench_section(config).replay is not None:
        raise UsageError("--emulate and bench.replay exclude each other: a replay uses no devices. Leave one out.")
    require_emulators()
    from sim_backend.emulators.launch import on_emulated_ports, started

    with started(config) as emulators:
        section = _bench_section(on_emulated_ports(config, emulators))
        stage = _bench_stage(section, Torque.EMULATED, raw_folder, emulators.clock)
        yield Stage(stage.rig, stage.clock, lambda: stage.account() | {"emulated_drive": emulators.events()})


BACKENDS: Mapping[str, Backend] = {SIMULATED: simulated, "bench": bench, EMULATED: emulated}


def backend_name(config: Config, dry_run: bool, emulate: bool) -> str:
    """The backend that was asked for. Raises UsageError for two at once."""
    if dry_run and emulate:
        raise UsageError(
            "--dry-run and --emulate exclude each other: the first simulates, the second emulates. Leave one out."
        )
    if dry_run:
        return SIMULATED
    return EMULATED if emulate else config.backend


def require_emulators() -> None:
    """Raise UsageError where there are no pseudo terminals to emulate devices on."""
    if sys.platform == "win32":
        raise UsageError("emulated devices need pseudo terminals, which Windows does not have. Use --dry-run instead.")


def _require_channels(config: Config) -> None:
    """Raise ConfigError where the declared model reads a channel that no bench reports."""
    if not config.model.channels:
        return
    from rig import effects

    for name in config.model.effects:
        read = effects.get(name).reads
        if read is not None and read.name not in BENCH_CHANNELS:
            raise ConfigError(
                f"model.effects.{name} reads the channel {read.name!r}, which the bench does not report (it reports "
                f"{' and '.join(BENCH_CHANNELS)}): take {name} out of the model, or record {read.name} beside the "
                "bench and identify with backend: recorded"
            )


def _bench_section(config: Config) -> BenchConfig:
    if config.bench is None:
        raise UsageError("the file has no `bench:` section. Add one as in examples/bench.yaml.")
    return config.bench


def _capture_of(folder: Path, named: str) -> Path:
    """The capture in a results folder, in its raw folder, or named itself; raises ConfigError where there is none."""
    from drivers.capture.wire_capture import FILE_NAME

    for base in (folder / named, Path(named)):
        for path in (base / "raw" / FILE_NAME, base / FILE_NAME, base):
            with suppress(OSError, ValueError):  # no name of a file
                if path.is_file():
                    return path
    raise ConfigError(
        f"bench.replay: there is no raw capture in {folder / named}: give the results folder of a bench run "
        f"(it holds raw/{FILE_NAME}), relative to the yaml or absolute"
    )


def _replayed(path: Path, section: BenchConfig) -> Stage:
    from drivers.replay import ReplayRig

    rig = ReplayRig(path)
    if otherwise := rig.differences(section):
        raise ConfigError(
            "bench.replay: these settings differ from those of the capture:\n  "
            + "\n  ".join(otherwise)
            + "\nSet them to the values of the capture; ports may differ."
        )
    return Stage(rig, rig.clock, lambda: {"replay_of": str(path)})


def _bench_stage(section: BenchConfig, torque: Torque, raw_folder: Path, clock: HostClock | None = None) -> Stage:
    from drivers.bench import BenchRig

    rig = BenchRig(section, torque, raw_folder, clock)
    return Stage(rig, rig.clock, lambda: _account(rig))


def _account(rig: BenchRig) -> dict[str, Any]:
    from rig.errors import DeviceFault

    try:
        report = rig.report()
    except DeviceFault:  # it was never open
        return {}
    return {"bench": asdict(report), "gyroscope": str(report.gyro)}
