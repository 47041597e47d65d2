"""`rig check`: everything that can be known to be wrong before a campaign, each with its cure.

Each check is one function from what is known to lines for the operator; one that fails raises, and the others
still speak. A further check is a function and a place in ``CHECKS``.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from commands.campaign.backends import BACKENDS, RECORDED, Stage, backend_name
from commands.campaign.context import CommandContext
from commands.campaign.limit_locations import with_locations
from commands.terminal.display import plain
from commands.terminal.exit_codes import OK
from rig.config.load import LoadedConfig
from rig.errors import Aborted, PreflightRefusal, RecordingError, RigError
from rig.interface import Torque
from rig.preflight import Prediction, limits_broken, playable_sets, predict_all

UNKNOWN_INERTIA_NOTE = (
    "forecast for a platform of unit inertia (model.inertia_unknown): declare the inertia to forecast the real travel"
)


@dataclass(frozen=True)
class CheckSubject:
    """What the checks look at. ``stage`` is None where nothing is played."""

    loaded: LoadedConfig
    stage: Stage | None

    @cached_property
    def predictions(self) -> tuple[Prediction, ...]:
        """What every set of the campaign would do."""
        config, rig = self.loaded.config, self.stage.rig if self.stage else None
        assert rig is not None
        scale, key = rig.rate_full_scale_rad_s, rig.rate_full_scale_key
        return predict_all(config.model.platform(), config.excitation, config.limits, scale, key)


Check = Callable[[CheckSubject], list[str]]


def configuration(subject: CheckSubject) -> list[str]:
    """That the file is sound: it would not have been loaded otherwise."""
    config = subject.loaded.config
    return [f"configuration {plain(str(subject.loaded.path))}: valid (backend {config.backend})"]


def forecast(subject: CheckSubject) -> list[str]:
    """Travel, rate and torque of every set. Raises PreflightRefusal where one may not be played."""
    if subject.stage is None:
        return []
    config = subject.loaded.config
    try:
        playable_sets(subject.predictions, config.model.platform(), config.excitation)
    except PreflightRefusal as error:
        raise with_locations(error, subject.loaded) from None
    doubt = [UNKNOWN_INERTIA_NOTE] if config.model.inertia_unknown else []
    origins = limits_broken(subject.predictions)
    limits = [f"limits {plain(origins)}"] if origins else []
    return doubt + limits + [f"forecast {plain(p.describe_as_played())}" for p in subject.predictions]


def recordings(subject: CheckSubject) -> list[str]:
    """That every recording can be read and trusted. Raises RecordingError."""
    if subject.stage is not None:
        return []
    from identify.runs.reading import describe_reading
    from rig.recording.load import read_recording

    lines = []
    runs = read_recording(subject.loaded).runs
    for run in runs:
        channels = [name for name, values in (("rate", run.rate_rad_s), ("angle", run.angle_rad)) if values is not None]
        torque = "with torque" if run.torque_nm is not None else "without torque (free decay)"
        lines.append(
            f"recording {plain(run.name)}: {len(run.time_s)} samples of {' and '.join(channels)} over "
            f"{run.duration_s:.3g} s, {int((~run.valid).sum())} invalid, {torque}, use: {run.use}"
        )
    return lines + [f"reading {plain(said)}" for said in describe_reading(runs, lambda _: None)]


def identifiability(subject: CheckSubject) -> list[str]:
    """What every set alone and all together can determine about the declared platform."""
    config = subject.loaded.config
    if subject.stage is None:
        from identify.bounds.recorded import of_recorded_campaign
        from rig.recording.load import read_recording

        try:
            recording = read_recording(subject.loaded)
        except RecordingError:  # said by the check before
            return []
        lines = of_recorded_campaign(recording, config.model.platform())
    else:
        from identify.bounds.planned import of_planned_campaign

        rig = subject.stage.rig
        platform = config.model.platform()
        # A set that would break a limit is refused by the forecast; here it speaks at the torque that passes.
        sets = [p.planned.scaled(p.scale) for p in subject.predictions if p.scale > 0.0]
        lines = of_planned_campaign(platform, sets, config.excitation.sample_rate_hz, rig.noise_rad_s)
    return [f"identifiability {plain(line)}" for line in lines]


def contact(subject: CheckSubject) -> list[str]:
    """That every device answers, without torque. Raises DeviceFault that lists all that do not."""
    stage = subject.stage
    if stage is None or stage.rig.statement().torque is Torque.SIMULATED:
        return []
    with stage.rig.opened():
        account = stage.account()
    return [f"device {line}" for line in _account_lines(account)]


def _account_lines(account: Mapping[str, Any]) -> Iterator[str]:
    bench = account.get("bench", {})
    yield plain(str(account.get("gyroscope", "gyroscope: answered")))
    for note in (*bench.get("gyro", {}).get("said", ()), *bench.get("amplifier_notes", ())):
        yield plain(str(note))
    if bench.get("real_time"):
        yield f"this computer: {plain(bench['real_time'])}"


CHECKS: tuple[Check, ...] = (configuration, recordings, forecast, identifiability, contact)


def run_checks(context: CommandContext, loaded: LoadedConfig) -> int:
    """Run all checks; lines go to stdout, what is wrong to stderr. Returns the exit code of the first fault."""
    code = OK
    with tempfile.TemporaryDirectory() as scratch, _subject(context, loaded, Path(scratch)) as subject:
        for check in CHECKS:
            try:
                lines = check(subject)
            except Aborted:
                raise
            except RigError as error:
                found = context.say_error(error)
                code = code or found
                continue
            sys.stdout.writelines(f"{line}\n" for line in lines)
            sys.stdout.flush()
    if code == OK:
        sys.stdout.write("All checks passed; nothing was moved.\n")
    return code


@contextmanager
def _subject(context: CommandContext, loaded: LoadedConfig, scratch: Path) -> Iterator[CheckSubject]:
    name = backend_name(loaded.config, False, context.options.emulate)
    if name == RECORDED:
        yield CheckSubject(loaded, None)
        return
    with BACKENDS[name](loaded, scratch / "raw") as stage:
        yield CheckSubject(loaded, stage)
