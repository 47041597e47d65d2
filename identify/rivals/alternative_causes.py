"""What else may pass for what was found: another torque in a few runs, a line of the sensor, flexible effects."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

from identify.estimate.final_fit import FinalFit
from identify.model.parameter_fit import ParameterFit
from identify.model.parameters import Name
from identify.model.structure import Structure
from identify.rivals import run_heterogeneity
from identify.rivals.tone_origin import TONE, describe, standing_line
from identify.rivals.whole_runs import FreeRunFitter
from identify.select.search_state import Search
from identify.signals.trace import Trace
from identify.wording import plain
from rig.platform import TERMS


@dataclass(frozen=True)
class AlternativeCauses:
    """Other causes than effects, looked at once a search is through.

    Attributes
    ----------
    fits
        Fits over whole runs.
    structure
        The declared model.
    """

    traces: Sequence[Trace]
    fits: FreeRunFitter
    structure: Structure
    axis: Literal["rotary", "linear"]
    say: Callable[[str], None]

    def other_cause(self, search: Search) -> bool:
        """Whether no effect but a few runs whose torque was another may be what is left."""
        return self._heterogeneous_runs(search, search.best.structure, search.best.values) is not None

    def mark_undetermined(self, search: Search, after: FinalFit) -> bool:
        """Take back from a search what may be something else; whether anything was."""
        line = standing_line(after, self.traces) if TONE not in self.structure.effects else None
        apart = None
        if line is None or line.of_torque:
            apart = self._heterogeneous_runs(search, after.structure, after.values)
        if apart is not None:
            search.mark_undetermined("", run_heterogeneity.describe(apart, self.axis == "linear"), search.base)
            self.say("no effect is named: the runs disagree with each other, and that alone explains as much")
        elif line is not None:
            words = describe(line, self.axis, self.traces[0].channel)
            search.mark_undetermined(TONE, words, self._until(search, TONE))
            self.say(f"not named: {plain(TONE)}; the line may come from the sensor itself")
        else:
            return False
        return True

    def _heterogeneous_runs(
        self, search: Search, structure: Structure, values: Mapping[Name, float]
    ) -> run_heterogeneity.Heterogeneity | None:  # fmt: skip
        """What would explain all that the declared model leaves, if it is likelier than what was named."""
        apart = run_heterogeneity.heterogeneity_of(self.fits, self.structure, search.base.values)
        if apart is None or structure == self.structure:
            return apart
        named = self.fits.fitted(structure, values)
        return apart if named is None or run_heterogeneity.explains_as_much(apart, named) else None

    def _until(self, search: Search, name: str) -> ParameterFit:
        """The model of what was found before an effect; the declared one where that is nothing."""
        best, base = search.best.structure, search.base.structure
        found = best.effects[: best.effects.index(name)]
        start = {**search.base.values, **{n: v for n, v in search.best.values.items() if n[0] in (*TERMS, *found)}}
        fitted = None if set(found) <= set(base.effects) else self.fits.fitted(replace(base, effects=found), start)
        return search.base if fitted is None else fitted
