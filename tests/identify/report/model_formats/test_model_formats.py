"""The exported model is the identified one: as JSON, as .mat and as Modelica, all numbers and equations."""

from __future__ import annotations

import io
import json
import math
import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import yaml
from scipy.integrate import solve_ivp
from scipy.io import loadmat
from scipy.signal import StateSpace, lsim

from identify.report.model_formats import content_of, file_of, name_for, names
from identify.report.model_formats.description import ModelDescription, described
from identify.results import ParameterEstimate
from identify.wording import plain
from rig import effects
from rig.config.model import ModelConfig
from rig.dynamics import TorqueSignal, simulate
from rig.effects.base import Place
from rig.errors import InputError
from rig.platform import Platform
from tests.identify.proof.test_controller import GIVEN
from tests.identify.sample import TRUTH, sample, unhappy

TIME = np.arange(2001) * 1e-3
TORQUE = 60.0 * np.sin(2.0 * np.pi * 3.0 * TIME)
SMOOTH = {
    "cubic_stiffness": {"factor": 1000.0},
    "quadratic_damping": {"factor": 0.01},
    "torque_offset": {"level": 0.4},
    "unbalance": {"sine": 10.0, "cosine": 2.0},
    "backlash": {"half_gap": 1e-3},
}


def model(platform: Platform = TRUTH, inertia_kg_m2: float | None = None, **changes: Any) -> ModelDescription:
    """The description of an identification that found ``platform``."""
    found, recording = sample(2.0)
    found = replace(found, after=replace(found.final, platform=platform), **changes)
    return described(found, recording, inertia_kg_m2)


def with_effects(given: Mapping[str, Mapping[str, float]]) -> Platform:
    return replace(TRUTH, effects=given)


def of_every_effect() -> Platform:
    """A platform that has all effects there are, every parameter somewhere within its bounds."""
    given = {}
    for name in effects.names():
        parameters = effects.get(name).parameters
        given[name] = {p.name: min(max(0.5, p.low), p.high) for p in parameters}
    return with_effects(given)


# ---------------------------------------------------------------------------------------------------------- JSON


def test_json_read_back_is_the_model() -> None:
    for platform in (TRUTH, with_effects({**SMOOTH, "creep": {"stiffness": 9.0, "time": 1.0}})):
        read = json.loads(content_of("model-json", model(platform)))
        again = ModelConfig(**read["model"]).platform()
        assert again == platform
        motions = [simulate(one, TIME, TorqueSignal(TIME, TORQUE)).rate_rad_s for one in (platform, again)]
        np.testing.assert_array_equal(*motions)


def test_json_is_a_model_that_a_configuration_takes() -> None:
    """JSON is YAML: the section can be pasted as it stands."""
    section = json.dumps(json.loads(content_of("model-json", model()))["model"])
    assert ModelConfig(**yaml.safe_load(section)).platform() == TRUTH


def test_json_has_every_number_with_unit_and_interval_and_every_effect_with_its_equation() -> None:
    found = sample(2.0)[0].final
    stiffness = ParameterEstimate.normal(TRUTH.stiffness_nm_rad, 0.3, "N*m/rad")
    level = ParameterEstimate.normal(1.2, 0.01, "N*m")
    after = replace(
        found, platform=TRUTH, parameters={**found.parameters, "stiffness": stiffness},
        effect_parameters={"coulomb_friction": {"level": level}},
    )  # fmt: skip
    description = described(replace(sample(2.0)[0], after=after), sample(2.0)[1])
    read = json.loads(content_of("model-json", description))
    assert read["parameters"]["stiffness"] == {
        "value": 681.2, "unit": "N*m/rad", "std_error": 0.3, "ci95": list(stiffness.ci95), "meaning": "K",
    }  # fmt: skip
    friction, delay = read["effects"]
    assert friction["equation"].startswith("T = level * sgn(w)") and friction["formula"] == "level_nm"
    assert friction["parameters"]["level_nm"]["ci95"] == list(level.ci95)
    assert delay["formula"] is None and delay["equation"] == "M(t) = torque(t - delay)"
    assert delay["parameters"]["delay_s"]["ci95"] is None  # no estimate of this number was given above


def test_an_interval_is_not_written_beside_another_number() -> None:
    """Of a parameter that the data do not determine the model keeps what was declared."""
    assert model().terms["inertia"].ci95 is None  # the sample's estimate is of 0.020301, the platform has 0.0203
    assert model(replace(TRUTH, inertia_kg_m2=sample(2.0)[0].final.parameters["inertia"].value)).terms["inertia"].ci95


def test_a_second_order_has_its_interval_under_the_name_that_the_tables_give_it() -> None:
    found, recording = sample(2.0)
    orders = {name: {"sine": 0.5, "cosine": 0.3, "order": n} for name, n in (("cogging", 12.0), ("cogging_2", 24.0))}
    of_both = {"order": ParameterEstimate.normal(12.0, 0.1, "1"), "order_2": ParameterEstimate.normal(24.0, 0.2, "1")}
    after = replace(found.final, platform=with_effects(orders), effect_parameters={"cogging": of_both})
    first, second = described(replace(found, after=after), recording).effects
    assert [one.numbers[2].std_error for one in (first, second)] == [0.1, 0.2]


# ---------------------------------------------------------------------------------------------------------- .mat


def test_mat_read_back_moves_as_the_platform_without_effects() -> None:
    content = content_of("model-mat", model())
    assert isinstance(content, bytes)
    read = loadmat(io.BytesIO(content), simplify_cells=True)
    linear = StateSpace(read["A"], read["B"].reshape(2, 1), read["C"], read["D"].reshape(2, 1))
    _, out, _ = lsim(linear, TORQUE, TIME)
    expected = simulate(with_effects({}), TIME, TorqueSignal(TIME, TORQUE))
    # lsim draws straight lines between samples, the product a spline: 1e-3 of the torque's curvature is left.
    np.testing.assert_allclose(out[:, 0], expected.angle_rad, atol=2e-4 * np.max(np.abs(expected.angle_rad)))
    np.testing.assert_allclose(out[:, 1], expected.rate_rad_s, atol=2e-4 * np.max(np.abs(expected.rate_rad_s)))


def test_mat_has_the_parameters_and_effects_as_structs() -> None:
    content = content_of("model-mat", model())
    assert isinstance(content, bytes)
    read = loadmat(io.BytesIO(content), simplify_cells=True)
    assert read["parameters"]["stiffness"]["value"] == TRUTH.stiffness_nm_rad
    assert read["parameters"]["damping"]["unit"] == "N*m*s/rad"
    assert read["effects"]["coulomb_friction"]["parameters"]["level_nm"]["value"] == 1.2
    assert read["effects"]["torque_delay"]["equation"] == "M(t) = torque(t - delay)"
    assert list(read["states"]) == ["angle_rad", "rate_rad_s"] and read["inputs"] == "torque_nm"


# ------------------------------------------------------------------------------------------------------ Modelica

PARAMETER = re.compile(r'  parameter Real (\w+)(?:\([^)]*\))? = (\S+) "[^"]*";')
VARIABLE = re.compile(r'  (?:input |output )?Real (\w+)(?:\([^)]*\))? "[^"]*";')
EQUATION = re.compile(r"  (.+) = (.+);")
IN_PYTHON: dict[str, Any] = {"abs": abs, "min": min, "max": max, "sin": math.sin, "cos": math.cos, "exp": math.exp}


class Read:
    """A model of Modelica, as far as what is written here needs: parameters, variables and explicit equations."""

    def __init__(self, text: str) -> None:
        lines = [line for line in text.splitlines() if not line.startswith("//")]
        head, begin, end = lines[0], lines.index("equation"), lines[-1]
        assert head.startswith("model Platform ") and end == "end Platform;"
        declared = [line for line in lines[1:begin] if line != "protected"]
        parameters = [m for line in declared if (m := PARAMETER.fullmatch(line))]
        variables = [m[1] for line in declared if (m := VARIABLE.fullmatch(line))]
        assert len(parameters) + len(variables) == len(declared), declared
        self.parameters = {m[1]: float(m[2]) for m in parameters}
        self.equations = [m.groups() for line in lines[begin + 1 : -1] if (m := EQUATION.fullmatch(line))]
        assert len(self.equations) == len(lines) - begin - 2
        # Balanced: an equation for every variable that is not an input.
        assert len(self.equations) == len(variables) - 1 and "tau" in variables
        words = {w for sides in self.equations for s in sides for w in re.findall(r"(?<![\w.])[A-Za-z_]\w*", s)}
        assert words <= {*self.parameters, *variables, *IN_PYTHON, "der"}, "an equation uses what is not declared"

    def acceleration(self, angle_rad: float, rate_rad_s: float, torque_nm: float) -> float:
        known = IN_PYTHON | self.parameters | {"phi": angle_rad, "w": rate_rad_s, "tau": torque_nm}
        for left, right in self.equations[2:]:
            known[left] = eval(right, {"__builtins__": {}}, known)
        assert self.equations[0] == ("der(phi)", "w") and self.equations[1][0] == "J*der(w)"
        return float(eval(self.equations[1][1], {"__builtins__": {}}, known)) / self.parameters["J"]


def modelica(platform: Platform, **changes: Any) -> str:
    text = content_of("modelica", model(platform, **changes))
    assert isinstance(text, str)
    return text


def test_modelica_is_balanced_and_has_the_numbers_whatever_the_model_has() -> None:
    platforms = [TRUTH, with_effects({}), of_every_effect(), replace(TRUTH, terms=("inertia", "damping"))]
    for platform in (*platforms, *(with_effects({name: given}) for name, given in GIVEN.items())):
        read = Read(modelica(platform))
        assert read.parameters["J"] == platform.inertia_kg_m2
        assert read.parameters["C"] == platform.damping_nm_s_rad


def test_modelica_has_what_has_a_formula_in_its_equations_and_all_else_in_a_comment() -> None:
    text = modelica(of_every_effect())
    for name in effects.names():
        effect = effects.get(name)
        assert (f"  tau_{name} = " in text) == bool(effect.formula)
        assert (f"// Not in the equation: {plain(name)}, because" in text) == (not effect.formula)
    assert "//   M(t) = torque(t - delay) with delay_s = 0.0006 s" in modelica(TRUTH)


@pytest.mark.parametrize("name", GIVEN)
def test_modelica_has_the_torque_of_the_kernel(name: str) -> None:
    effect, platform = effects.get(name), with_effects({name: GIVEN[name]})
    read = Read(modelica(platform))
    bare = Read(modelica(with_effects({})))
    at = (0.02, 0.9, 7.0)
    resisting = platform.inertia_kg_m2 * (bare.acceleration(*at) - read.acceleration(*at))
    by_name: Mapping[str, Callable[..., float]] = {"fabs": abs, "fmin": min, "fmax": max}
    keys = {p.key: GIVEN[name][p.name] for p in effect.parameters}
    known = IN_PYTHON | by_name | keys | {"stiffness_nm_rad": platform.stiffness_nm_rad}
    known |= dict(zip(("angle_rad", "rate_rad_s", "torque_nm"), at, strict=True))
    assert resisting == pytest.approx(eval(effect.formula, {"__builtins__": {}}, known), rel=1e-9)
    assert effect.place in (Place.LOAD, Place.FRICTION)


def test_modelica_integrated_moves_as_the_simulator() -> None:
    platform = with_effects(SMOOTH)
    read = Read(modelica(platform))
    signal = TorqueSignal(TIME, TORQUE)
    expected = simulate(platform, TIME, signal)

    def motion(time: float, state: Any) -> tuple[float, float]:
        torque = 60.0 * math.sin(2.0 * math.pi * 3.0 * time)
        return float(state[1]), read.acceleration(float(state[0]), float(state[1]), torque)

    found = solve_ivp(motion, (0.0, 0.5), (0.0, 0.0), t_eval=TIME[:501], rtol=1e-8, atol=1e-10, max_step=2e-3)
    np.testing.assert_allclose(found.y[0], expected.angle_rad[:501], atol=1e-4 * np.max(np.abs(expected.angle_rad)))
    np.testing.assert_allclose(found.y[1], expected.rate_rad_s[:501], atol=1e-4 * np.max(np.abs(expected.rate_rad_s)))


def test_dry_friction_in_modelica_is_soft_below_what_the_recording_tells() -> None:
    text = modelica(with_effects({"coulomb_friction": {"level": 1.0}}))
    read = Read(text)
    soft = read.parameters["soft_rate"]
    assert 0.0 < soft < 0.1 and "Dry friction does not hold the platform here" in text
    half = [read.acceleration(0.0, sign * 0.5 * soft, 0.0) for sign in (1.0, -1.0)]
    assert half[0] == -half[1] == pytest.approx(-(0.5 + TRUTH.damping_nm_s_rad * 0.5 * soft) / TRUTH.inertia_kg_m2)


# ----------------------------------------------------------------------------------------------------- all formats


def test_a_linear_axis_has_its_units() -> None:
    description = model(with_effects({"cubic_stiffness": {"factor": 1000.0}}), axis="linear")
    assert [n.unit for n in description.terms.values()] == ["kg", "N*s/m", "N/m"]
    text = content_of("modelica", description)
    assert isinstance(text, str)
    for line in ('tau(unit = "N")', 'phi(unit = "m", ', 'w(unit = "m/s", ', '(unit = "N/m3") = 1000.0'):
        assert line in text, line


def test_a_decay_without_an_inertia_says_that_all_is_over_the_inertia() -> None:
    ratios = Platform(1.0, 2.2, 33000.0, {"coulomb_friction": {"level": 50.0}})
    alone = model(ratios, torque_free=True)
    assert alone.per_inertia and alone.terms["stiffness"].unit == "N*m/rad/(kg*m^2)"
    assert model(ratios, torque_free=True, axis="linear").terms["damping"].unit == "N*s/m/(kg)"
    read = json.loads(content_of("model-json", alone))
    assert read["model"]["inertia_unknown"] is True
    assert read["state_space"]["inputs"] == ["torque_over_inertia_rad_s2"]
    assert "// Only ratios to the inertia are known" in modelica(ratios, torque_free=True)
    scaled = model(ratios, torque_free=True, inertia_kg_m2=0.02)
    assert not scaled.per_inertia
    assert scaled.platform.stiffness_nm_rad == pytest.approx(660.0)
    assert scaled.platform.effects["coulomb_friction"]["level"] == pytest.approx(1.0)


def test_a_model_that_was_not_accepted_says_so_in_every_format() -> None:
    description = model(accepted=False, reasons=("too little\nwas moved",))
    for name in names():
        content = content_of(name, description)
        if isinstance(content, str):
            assert "NOT ACCEPTED: too little was moved" in content
    assert not loadmat(io.BytesIO(bytes(content_of("model-mat", description))), simplify_cells=True)["accepted"]


def test_where_no_model_came_out_or_it_cannot_move_that_is_said() -> None:
    with pytest.raises(InputError, match="no model could be identified"):
        described(replace(unhappy(), after=None, before=replace(unhappy().before, platform=None)), sample(2.0)[1])
    with pytest.raises(InputError, match=r"no platform has the identified numbers \(J = -0\.02, C = 0\.0447"):
        model(replace(TRUTH, inertia_kg_m2=-0.02))


def test_a_format_goes_by_the_suffix_of_its_file() -> None:
    assert [name_for(f".{file_of(name).split('.')[1].upper()}") for name in names()] == list(names())
    with pytest.raises(InputError, match=r"ends in \.json, \.mat, \.mo"):
        name_for(".fmu")
