"""Effects of the user's own that a results folder names: their code is run only when its file is named anew."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from identify.report.report_data import ReportData
from identify.results import Identification
from rig import effects
from rig.errors import UsageError


def make_effects_known(data: ReportData, files: Sequence[Path]) -> None:
    """Run the ``files`` of effects, and make those of measured channels, so that all of the model can be looked up.

    Raises UsageError, with the option to give, where an effect is still not known.
    """
    for file in files:
        effects.read_file(file)
    effects.declare_channels(data.channels)
    missing = [name for name in dict.fromkeys(_effects_in(data.identification)) if not effects.exists(name)]
    if missing:
        raise UsageError(
            f"the model has effects of your own ({', '.join(missing)}), and code is not run unasked: give their file "
            f"with {option_for(data, missing)}"
        )


def own_effects_in(data: ReportData) -> tuple[str, ...]:
    """The effects of the user's own that the models have, by name; nothing of theirs is run."""
    return tuple(name for name in dict.fromkeys(_effects_in(data.identification)) if name in data.own_effects)


def option_for(data: ReportData, names: Iterable[str]) -> str:
    """The option that names the files of these effects, as the results folder remembers them."""
    sources = {data.own_effects[name] for name in names if name in data.own_effects}
    return " ".join(f"--effects {source}" for source in sorted(sources)) or "--effects FILE"


def _effects_in(identification: Identification) -> Iterator[str]:
    """The effects that are looked up."""
    yield from identification.verdict.effects
    for model in (identification.before, identification.after):
        if model is not None:
            yield from model.effect_parameters
            yield from model.platform.effects if model.platform is not None else ()
