"""What an effect of a model may be instead: a simpler one that it contains, begun from its numbers."""

from __future__ import annotations

from identify.parameters import Name
from identify.whole_runs import Whole
from rig import effects


def special_cases(model: Whole, name: str) -> dict[str, dict[Name, float]]:
    """Start values of every effect that ``name`` contains as a special case.

    A parameter of the same name keeps its value, a gain takes the largest of the richer one's; what has a shape that
    the richer one does not know is left out.
    """
    values, richer = model.values(), effects.get(name)
    gains = [values[(name, p.name)] for p in richer.parameters if p.linear and (name, p.name) in values]
    out: dict[str, dict[Name, float]] = {}
    for simpler in richer.nests:
        own: dict[Name, float] = {}
        for p in effects.get(simpler).parameters:
            if (name, p.name) in values:
                own[(simpler, p.name)] = values[(name, p.name)]
            elif p.linear and gains:
                own[(simpler, p.name)] = max(gains)
        if len(own) == len(effects.get(simpler).parameters):
            out[simpler] = own
    return out
