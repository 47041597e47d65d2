"""The model as MATLAB's .mat, version 5: A, B, C, D of J, C and K; structs of the parameters and of the effects."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from typing import Any, cast

import numpy as np
from scipy.io import savemat

from identify.model.linear_matrices import STATE_NAMES, input_name, linear_matrices
from identify.report.model_formats.description import EQUATION, DescribedEffect, ModelDescription, Number


def content(model: ModelDescription) -> bytes:
    """The bytes."""
    a, b, c, d = linear_matrices(model.platform)
    values = {
        "A": a, "B": b, "C": c, "D": d,
        "states": _cells(STATE_NAMES), "outputs": _cells(STATE_NAMES),
        "inputs": _cells([input_name(model.per_inertia)]),
        "parameters": {name: _number(number) for name, number in model.terms.items()},
        "effects": {one.name: _effect(one) for one in model.effects},
        "equation": EQUATION, "about": _cells(model.about()), "version": model.version,
        "accepted": model.accepted, "per_inertia": model.per_inertia,
    }  # fmt: skip
    file = io.BytesIO()
    # The stubs ask for a name; savemat takes an open file as well.
    savemat(cast(str, file), values, long_field_names=True, do_compression=True, oned_as="column")
    return file.getvalue()


def _number(number: Number) -> Mapping[str, Any]:
    return {
        "value": number.value,
        "unit": number.unit,
        "std_error": np.nan if number.std_error is None else number.std_error,
        "ci95": np.array([[np.nan, np.nan]] if number.ci95 is None else [number.ci95]),
        "meaning": number.meaning,
    }


def _effect(one: DescribedEffect) -> Mapping[str, Any]:
    return {
        "equation": one.effect.equation,
        "formula": one.term.expression if one.term else "",
        "place": one.effect.place.value,
        "parameters": {number.key: _number(number) for number in one.numbers},
    }


def _cells(texts: Sequence[str]) -> Any:
    """A row of a cell array: texts of unlike length."""
    out = np.empty((1, len(texts)), dtype=object)
    out[0, :] = list(texts)
    return out
