"""A result prints, shows, simulates and draws what was found."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest

from identify.api.call import identify
from identify.api.result import Result
from identify.report.files import result_json
from identify.report.summary import summary
from identify.residual import Dependence, Disturbance
from rig.config.model import ModelConfig
from rig.dynamics import TorqueSignal, simulate
from rig.errors import InputError, MissingPackage
from tests.identify.sample import TRUTH, sample, unhappy
from tests.identify.simulated import decay_run

TIME = np.arange(2000) * 1e-3
PLOTS = ("motion", "residual", "spectrum", "response", "parameters", "convergence")


@pytest.fixture(autouse=True)
def _no_window() -> Iterator[None]:
    from matplotlib import pyplot  # noqa: PLC0415

    mpl.use("agg")
    yield
    pyplot.close("all")


def result() -> Result:
    found, recording = sample(2.0)
    return Result(replace(found, after=replace(found.final, platform=TRUTH)), recording, ModelConfig())


def of_decay(**declared: float) -> Result:
    run = decay_run(replace(TRUTH, effects={}, stiffness_nm_rad=2.0), duration_s=6.0)
    return identify(run.time_s, angle_rad=run.angle_rad, declared=declared, settings={"candidates": []})


def test_it_prints_as_the_summary_and_says_itself_in_a_line() -> None:
    one = result()
    assert str(one) == summary(one.identification)
    assert repr(one).startswith("<identify.Result, accepted: J = 0.0203")
    assert repr(one).endswith("effects added: Coulomb friction, torque delay>")
    assert "\n" not in repr(one)


def test_its_values_are_those_of_the_final_model_and_its_keys_those_of_the_file() -> None:
    one = result()
    assert one.parameters["inertia"].value == pytest.approx(0.0203, rel=1e-3)
    assert list(one.effects) == list(one.to_dict()["verdict"]["effects"]) == ["coulomb_friction", "torque_delay"]
    assert one.effects["coulomb_friction"]["level"].unit == "N*m"
    assert one.to_dict() == result_json(one.identification)
    assert one.accepted and not one.reasons and not one.aborted
    assert one.verdict == one.identification.verdict.sentences


def test_a_notebook_gets_tables_without_scripts_and_nothing_from_outside_as_markup() -> None:
    found, recording = sample(2.0)
    verdict = replace(found.verdict, sentences=("<script>alert(1)</script>",))
    html = Result(replace(found, verdict=verdict), recording, ModelConfig())._repr_html_()
    assert "ACCEPTED" in html and "<table>" in html and "rotary inertia J" in html
    assert "<script" not in html and "&lt;script&gt;" in html
    assert "NOT ACCEPTED" in Result(replace(unhappy(), aborted=False), recording, ModelConfig())._repr_html_()


def test_the_twin_moves_as_the_final_model_with_its_effects() -> None:
    torque = 40.0 * np.sin(30.0 * TIME)
    motion = result().simulate(list(TIME), list(torque), angle_rad=0.01, rate_rad_s=-0.2)
    expected = simulate(TRUTH, TIME, TorqueSignal(TIME, torque), (0.01, -0.2))
    np.testing.assert_array_equal(motion.rate_rad_s, expected.rate_rad_s)
    np.testing.assert_array_equal(motion.angle_rad, expected.angle_rad)
    assert motion.angle_rad[0] == 0.01 and motion.rate_rad_s[0] == -0.2


def test_what_the_twin_cannot_do_is_refused_with_the_cure() -> None:
    one = result()
    for arguments, words in (
        ((TIME, TIME[:3]), "torque_nm has 3 values and time_s has 2000"),
        ((TIME[::-1], None), "time_s falls from"),
        ((TIME[:1], None), r"time_s has 1 value\(s\): pass at least 2"),
        ((TIME * 1e3, None), r"samples 1 s apart, too far .* \(183\.2 rad/s\): pass samples at most 0\.084 s apart"),
    ):
        with pytest.raises(InputError, match=words):
            one.simulate(*arguments)
    with pytest.raises(InputError, match=r"the start .* is not finite"):
        one.simulate(TIME, angle_rad=np.nan)
    with pytest.raises(InputError, match="torque_hold is 'linear'"):
        one.simulate(TIME, TIME, torque_hold="linear")  # type: ignore[arg-type]


def test_a_decay_is_simulated_without_torque_and_with_one_only_where_the_inertia_was_declared() -> None:
    unknown, known = of_decay(), of_decay(inertia_kg_m2=0.0203)
    assert set(unknown.parameters) == {"damping_over_inertia", "stiffness_over_inertia"}
    assert unknown.disturbance is None or unknown.disturbance.unit
    assert np.ptp(unknown.simulate(TIME, angle_rad=0.1).angle_rad) > 0.1
    with pytest.raises(InputError, match="no inertia was declared, so the response to a torque is not known"):
        unknown.simulate(TIME, np.ones(len(TIME)))
    assert known.platform.stiffness_nm_rad == pytest.approx(2.0, rel=0.01)
    assert np.ptp(known.simulate(TIME, np.ones(len(TIME))).angle_rad) > 0.1
    assert unknown.state_space().input_labels == ["torque_over_inertia_rad_s2"]


def test_the_state_space_has_the_poles_of_the_final_platform() -> None:
    system = result().state_space()
    expected = np.roots([TRUTH.inertia_kg_m2, TRUTH.damping_nm_s_rad, TRUTH.stiffness_nm_rad])
    np.testing.assert_allclose(sorted(system.poles(), key=np.imag), sorted(expected, key=np.imag))
    assert (system.input_labels, system.output_labels) == (["torque_nm"], ["angle_rad", "rate_rad_s"])
    np.testing.assert_allclose(system.dcgain().ravel(), [1.0 / TRUTH.stiffness_nm_rad, 0.0], atol=1e-12)


def test_the_transfer_function_is_the_state_space() -> None:
    one = result()
    found, expected = one.transfer_function(), one.state_space()
    at = [0.0, 3j, 180j, 1000j]
    np.testing.assert_allclose([found(s) for s in at], [expected(s) for s in at], rtol=1e-9, atol=1e-15)
    assert (found.input_labels, found.output_labels) == (["torque_nm"], ["angle_rad", "rate_rad_s"])
    gain = 1.0 / TRUTH.inertia_kg_m2
    assert [list(row[0]) for row in found.num] == [[gain], [gain, 0.0]]


def test_the_model_is_written_for_other_programs_by_the_suffix(tmp_path: Path) -> None:
    one = result()
    for name in ("model.json", "model.mat", "Platform.mo"):
        assert one.save_model(tmp_path / name).stat().st_size > 500
    assert json.loads((tmp_path / "model.json").read_text(encoding="utf-8"))["parameters"]["inertia"]["value"] == 0.0203
    with pytest.raises(InputError, match="exists and is never overwritten"):
        one.save_model(tmp_path / "model.json")
    with pytest.raises(InputError, match="cannot be written"):
        one.save_model(tmp_path / "absent" / "model.json")
    with pytest.raises(InputError, match=r"ends in \.json, \.mat, \.mo, not in '\.fmu'"):
        one.save_model(tmp_path / "model.fmu")


@pytest.mark.parametrize(
    ("package", "call"),
    [("control", "state_space"), ("control", "transfer_function"), ("matplotlib", "plot_motion")],
)
def test_a_package_that_is_absent_is_said_with_the_line_that_installs_it(
    package: str, call: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(MissingPackage, match=r"not installed: pip install 'isp-rig\[notebook\]'"):
        getattr(result(), call)()
    assert issubclass(MissingPackage, ImportError)


@pytest.mark.parametrize("plot", PLOTS)
def test_a_plot_is_a_figure_with_axes_lines_and_titles(plot: str, tmp_path: Path) -> None:
    figure = getattr(result(), f"plot_{plot}")()
    assert all(panel.lines for panel in figure.axes)
    assert any(panel.get_xlabel() for panel in figure.axes)
    figure.savefig(tmp_path / "figure.png")
    assert (tmp_path / "figure.png").stat().st_size > 5_000


def test_a_plot_shows_the_samples_of_the_run_that_was_asked_for() -> None:
    one = result()
    trace = one.identification.traces[1]
    for run in (1, trace.name):
        figure = one.plot_motion(run)
        drawn = np.asarray(figure.axes[0].lines[0].get_ydata())
        assert drawn.max() == pytest.approx(trace.measured.max(), rel=1e-6)  # all peaks are kept
        assert figure.legends[0].get_texts()[0].get_text() == "measured"


def test_the_residual_is_drawn_against_what_was_asked_for() -> None:
    titles = {which: result().plot_residual(which).axes[0].get_xlabel() for which in ("angle", "rate", "direction")}  # type: ignore[arg-type]
    assert titles == {"angle": "angle (rad)", "rate": "rate (rad/s)", "direction": "angle (rad)"}


def test_the_shape_of_what_is_left_is_drawn_where_there_is_one() -> None:
    one = result()
    with pytest.raises(InputError, match="depends on no quantity that was tested"):
        Result(replace(one.identification, disturbance=None), one.recording, ModelConfig()).plot_disturbance()
    part = Dependence("angle", 0.1, 0.01, 1e-6, (-0.1, 0.0, 0.1), (-1.0, 0.0, 1.0))
    left = replace(one.identification, disturbance=Disturbance(0.1, "N*m", 0.01, (part,)))
    line = Result(left, one.recording, ModelConfig()).plot_disturbance().axes[0].lines[0]
    np.testing.assert_allclose(np.asarray(line.get_xydata()), [[-0.1, -1.0], [0.0, 0.0], [0.1, 1.0]], rtol=1e-6)


def test_a_plot_that_does_not_exist_is_refused_with_what_does() -> None:
    with pytest.raises(InputError, match=r"run is 9, .*: 0 \('0.5 Hz'\), 1"):
        result().plot_motion(9)
    with pytest.raises(InputError, match="choose one of 'time', 'angle', 'direction', 'rate'"):
        result().plot_residual("torque")  # type: ignore[arg-type]


def test_it_is_saved_as_a_results_folder_and_never_over_one(tmp_path: Path) -> None:
    one = result()
    folder = one.save(tmp_path / "new" / "folder")
    names = {p.name for p in folder.iterdir()}
    assert {"result.json", "report.html", "model.yaml", "recording.h5"} <= names
    assert (folder / "model.yaml").read_text(encoding="utf-8") == one.model_yaml()
    with pytest.raises(InputError, match="exists and is never overwritten"):
        one.save(folder)
