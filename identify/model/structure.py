"""Which terms and effects a model has, whatever their values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from rig import effects
from rig.effects.base import Place
from rig.platform import TERMS

Shapes = Mapping[str, tuple[float, ...]]
Label = tuple[str, ...]
# Stands for a term where one parameter of an effect is set to 1; negative, so that it is no index of one of these.
UNIT = {"inertia": -3, "damping": -2, "stiffness": -1}


@dataclass(frozen=True)
class Structure:
    """Which terms and effects a model has, whatever their values."""

    terms: tuple[str, ...] = TERMS
    effects: tuple[str, ...] = ()

    @property
    def acts_on_motion(self) -> bool:
        """Whether an effect acts on the motion itself: what a disturbance does then depends on where the motion is."""
        return any(effects.get(e).place in (Place.LOAD, Place.FRICTION) for e in self.effects)

    @property
    def parts(self) -> tuple[frozenset[str], frozenset[str]]:
        """Its terms and its effects, whatever their order."""
        return frozenset(self.terms), frozenset(self.effects)

    def plus(self, *names: str) -> Structure:
        """With more effects."""
        return replace(self, effects=(*self.effects, *names))

    def other_order(self) -> Structure | None:
        """The same with the last effect ahead of all others, where that is another drive; else None.

        A current loop that lags and an amplifier that clips give another torque in the other order.
        """
        if not self.effects:
            return None
        *others, last = (effects.get(e) for e in self.effects)
        matters = any((e.bends_torque and last.spreads) or (e.spreads and last.bends_torque) for e in others)
        return replace(self, effects=(self.effects[-1], *self.effects[:-1])) if matters else None

    def has_the_drive_of(self, other: Structure) -> bool:
        """Whether its drive has the same effects in the same order."""
        mine, theirs = ([e for e in s.effects if effects.get(e).place is Place.DRIVE] for s in (self, other))
        return mine == theirs

    def minus(self, name: str) -> Structure:
        """With one effect or term less."""
        return replace(
            self,
            terms=tuple(t for t in self.terms if t != name),
            effects=tuple(e for e in self.effects if e != name),
        )

    def shapes_of(self, values: Mapping[Label, float]) -> dict[str, tuple[float, ...]]:
        """Shape parameters of every effect, of parameters by name."""
        return {
            name: tuple(values[(name, p.name)] for p in effects.get(name).parameters if not p.linear)
            for name in self.effects
        }

    def labels(self, runs: int) -> tuple[Label, ...]:
        """What the columns of the regression are called; a gain per run has the run's number behind it."""
        out: list[Label] = [(t,) for t in TERMS if t in self.terms]
        for name in self.effects:
            for parameter in effects.get(name).parameters:
                if parameter.linear and parameter.per_run:
                    out += [(name, parameter.name, str(r)) for r in range(runs)]
                elif parameter.linear:
                    out.append((name, parameter.name))
        return tuple(out)


def shape_values(name: str, values: Mapping[str, float]) -> tuple[float, ...]:
    """Shape parameters of an effect in declared order."""
    return tuple(float(values[p.name]) for p in effects.get(name).parameters if not p.linear)
