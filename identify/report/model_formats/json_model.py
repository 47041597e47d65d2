"""The model as JSON: every number with its interval and unit, every effect with its equation, the matrices."""

from __future__ import annotations

import json
from typing import Any

import yaml

from identify.model.linear_matrices import STATE_NAMES, input_name, linear_matrices
from identify.report.json_values import finite
from identify.report.model_formats.description import EQUATION, DescribedEffect, ModelDescription, Number

FORMAT = "isp-rig model"
MODEL_JSON_VERSION = 1  # of the keys of this file


def content(model: ModelDescription) -> str:
    """The text.

    ``model`` in it is the section of that name of a rig.yaml, so that the file can be declared or simulated again.
    """
    return json.dumps(finite(_values(model)), indent=1, allow_nan=False) + "\n"


def _values(model: ModelDescription) -> dict[str, Any]:
    a, b, c, d = (matrix.tolist() for matrix in linear_matrices(model.platform))
    inputs = [input_name(model.per_inertia)]
    return {
        "format": FORMAT,
        "format_version": MODEL_JSON_VERSION,
        "about": model.about(),
        "version": model.version,
        "axis": model.axis,
        "accepted": model.accepted,
        "per_inertia": model.per_inertia,
        "equation": EQUATION,
        "parameters": {name: _number(number) for name, number in model.terms.items()},
        "effects": [_effect(one) for one in model.effects],
        "state_space": {
            "A": a, "B": b, "C": c, "D": d, "states": STATE_NAMES, "inputs": inputs, "outputs": STATE_NAMES
        },
        "model": yaml.safe_load(model.section),
    }  # fmt: skip


def _number(number: Number) -> dict[str, Any]:
    return {
        "value": number.value, "unit": number.unit, "std_error": number.std_error, "ci95": number.ci95,
        "meaning": number.meaning,
    }  # fmt: skip


def _effect(one: DescribedEffect) -> dict[str, Any]:
    return {
        "name": one.name,
        "place": one.effect.place.value,
        "equation": one.effect.equation,
        "formula": one.term.expression if one.term else None,
        "meaning": one.effect.meaning,
        "sign": one.effect.sign,
        "source": one.effect.source,
        "parameters": {number.key: _number(number) for number in one.numbers},
    }
