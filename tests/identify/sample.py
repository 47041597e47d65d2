"""An identification as the loop leaves it, filled by hand around a small simulated recording."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

import numpy as np

from identify.diagnose.diagnosis import with_diagnosis
from identify.genetic.algorithm import QuadraticObjective, search
from identify.results import (
    Candidate,
    Errors,
    GeneticRun,
    Identification,
    ModelResult,
    NoiseFloor,
    NotReported,
    ParameterEstimate,
    RunTraces,
    SetResult,
    Verdict,
)
from rig.config.identify import GeneticConfig
from rig.dynamics import TorqueSignal, simulate
from rig.platform import Platform
from rig.recording.run import Array, Recording, Run

SETS = ((0.5, 111.0), (1.0, 111.0), (3.0, 104.0), (6.0, 67.0), (9.0, 42.0))
SIGMA = float(np.deg2rad(0.05))
TRUTH = Platform(0.0203, 0.0447, 681.2, {"coulomb_friction": {"level": 1.2}, "torque_delay": {"delay": 6e-4}})
BENT = Platform(0.02028, 0.412, 681.9)
UNITS = {"inertia": "kg*m^2", "damping": "N*m*s/rad", "stiffness": "N*m/rad"}
REFERENCE = {"inertia": 0.0203, "damping": 0.0447, "stiffness": 681.2}


def estimate(
    value: float, std_error: float, unit: str = "kg*m^2", max_error_percent: float | None = None
) -> ParameterEstimate:
    """A number with a normal interval."""
    interval = (value - 1.96 * std_error, value + 1.96 * std_error)
    return ParameterEstimate(value, std_error, interval, unit, max_error_percent)


def _three(values: tuple[float, float, float], relative: tuple[float, float, float]) -> dict[str, ParameterEstimate]:
    return {
        name: estimate(v, abs(v) * r, UNITS[name], 100.0 * abs(v / REFERENCE[name] - 1.0))
        for name, v, r in zip(UNITS, values, relative, strict=True)
    }


@cache
def sample(duration_s: float = 10.0) -> tuple[Identification, Recording]:
    """Coulomb friction and a small torque delay that the declared model lacks, found and accepted."""
    rng, runs, traces = np.random.default_rng(1), [], []
    time = np.arange(round(duration_s * 1000) + 1) * 1e-3
    for hertz, size in SETS:
        torque = TorqueSignal(time, size * np.sin(2.0 * np.pi * hertz * time))
        true, bent = (simulate(platform, time, torque) for platform in (TRUTH, BENT))
        noise = SIGMA * rng.standard_normal(len(time))
        measured = true.sensed_rate_rad_s + noise
        name = f"{hertz:g} Hz"
        runs.append(
            Run(
                name,
                time,
                np.ones(len(time), bool),
                rate_rad_s=measured,
                torque_time_s=time,
                torque_nm=torque.torque_nm,
                frequency_hz=hertz,
            )
        )
        floor = 0.016 * np.convolve(rng.standard_normal(len(time)), np.full(4, 0.5), "same")
        friction = 1.2 * np.tanh(true.rate_rad_s / 0.02) - 0.37 * true.rate_rad_s
        holdout = ((time > 0.4 * duration_s) & (time < 0.6 * duration_s)).astype(float)
        traces.append(
            RunTraces(
                name=name,
                time_s=time,
                measured=measured,
                channel="rate",
                keep=np.ones(len(time)),
                simulated_before=bent.sensed_rate_rad_s,
                simulated_after=true.sensed_rate_rad_s,
                torque_residual_before=friction + floor,
                torque_residual_after=floor,
                angle_rad=true.angle_rad,
                rate_rad_s=true.rate_rad_s,
                torque_nm=torque.torque_nm,
                holdout=holdout,
                frequency_hz=hertz,
            )
        )
    found = with_diagnosis(_identification(tuple(traces)))
    return found, Recording(tuple(runs), info={"backend": "SIMULATED torque: nothing moves"})


@cache
def _genetic(name: str, seed: int) -> GeneticRun:
    rng = np.random.default_rng(seed)
    columns = rng.standard_normal((4000, 3)) @ np.array([[1.0, 0.0, -0.97], [0.0, 0.3, 0.0], [0.0, 0.0, 0.2]])
    truth = np.array(list(REFERENCE.values()))
    columns = 40.0 * SIGMA * columns / truth
    target = columns @ truth + SIGMA * rng.standard_normal(4000)
    form = QuadraticObjective(columns.T @ columns, columns.T @ target, float(target @ target))
    j_dec = 1.1 * form.minimum
    found = search(form, truth / 12.0, truth * 9.0, GeneticConfig(), rng, j_dec)

    def named(values: Array) -> dict[str, float]:
        return dict(zip(UNITS, values.tolist(), strict=True))

    return GeneticRun(
        name=name,
        parameters=named(found.best),
        closed_form=named(form.closed_form),
        gap_percent=named(form.gap_percent(found.best)),
        objective=found.objective,
        j_dec=j_dec,
        restarts=found.restarts,
        accepted=found.accepted,
        history=found.history,
        roulette_only=named(form.closed_form * [1.002, 0.97, 0.999]),
        plain_objective=named(form.closed_form * [1.0004, 1.012, 1.0]),
        closed_form_objective=form.minimum,
    )


@cache  # the same whatever the duration
def _sets() -> tuple[SetResult, ...]:
    relative = {0.5: 2.4e-5, 1.0: 1.2e-5, 3.0: 5e-6, 6.0: 3e-6, 9.0: 3e-6}
    results = []
    for i, (hertz, _) in enumerate(SETS):
        r = relative[hertz]
        values = (0.0203 * (1 + r * (-1) ** i), 0.0447 * (1 + 5 * r), 681.2 * (1 - r * 0.7))
        parameters = _three(values, (r, 7 * r, r))
        identifiable = ("inertia", "damping", "stiffness")
        advice = "determines all three; its transient separates inertia from stiffness"
        if hertz == 9.0:
            del parameters["damping"]
            identifiable = ("inertia", "stiffness")
            advice = "damping is not determined here: at least 5 s more of the ring-down would do"
        genetic = _genetic(f"{hertz:g} Hz", i)
        results.append(
            SetResult(
                f"{hertz:g} Hz",
                hertz,
                parameters,
                genetic.objective,
                genetic.restarts,
                genetic.accepted,
                identifiable,
                advice,
                genetic,
            )
        )
    return tuple(results)


def _identification(traces: tuple[RunTraces, ...]) -> Identification:
    effects: Mapping[str, Mapping[str, ParameterEstimate]] = {
        "coulomb_friction": {"level": estimate(1.1998, 0.0004, "N*m")},
        "torque_delay": {"delay": estimate(6.003e-4, 4e-7, "s")},
    }
    verdict = Verdict(
        effects=("coulomb_friction", "torque_delay"),
        confusable_with={"coulomb_friction": ("presliding_friction",), "torque_delay": ("actuator_lag",)},
        never_separable={
            "torque_delay / sensor_lag": "to first order a lag of the gyro acts like a delay of the torque"
        },
        unexplained_fraction=0.004,
        unexplained=False,
        candidates=(
            Candidate("coulomb_friction", 1, -215234.1, 0.0149, "added"),
            Candidate("stribeck_friction", 1, -215201.7, 0.0150, "rival"),
            Candidate("presliding_friction", 1, -214310.0, 0.0162, "rival"),
            Candidate("torque_delay", 1, -98023.0, 0.202, "not tried further"),
            Candidate("cubic_stiffness", 1, 4.2, 0.412, "no better"),
            Candidate("torque_delay", 2, -31022.5, 0.00088, "added"),
            Candidate("actuator_lag", 2, -30912.5, 0.00091, "rival"),
            Candidate("unbalance", 2, 18.8, 0.0149, "no better"),
            Candidate("cogging", 2, 31.1, None, "not tried further"),
        ),
        sentences=(
            "The declared model leaves an error of 402 times the noise floor.",
            "Coulomb friction is missing: 1.1998 N·m, found first; it explains 96 % of the residual.",
            "A torque delay of 0.600 ms is missing as well.",
            "With both, the residual is white and at the noise floor.",
        ),
        contribution={"coulomb_friction": 230.1, "torque_delay": 17.2},
    )
    return Identification(
        accepted=True,
        reasons=(),
        axis="rotary",
        before=ModelResult(
            parameters=_three((0.02028, 0.412, 681.9), (4e-4, 1.2e-2, 3e-4)),
            effect_parameters={},
            error=Errors(0.8123, 0.3507, 93.1, 0.0121, 0.0119, 120.0),
            correlation={"inertia, stiffness": 0.9965, "inertia, damping": -0.01},
            platform=BENT,
        ),
        verdict=verdict,
        after=ModelResult(
            parameters=_three((0.02030003, 0.0447012, 681.2009), (2e-6, 1.4e-5, 2e-6)),
            effect_parameters=effects,
            error=Errors(0.01624, 0.000876, 99.96, 0.00024, 0.00024, 120.0),
            correlation={"inertia, stiffness": 0.9966, "damping, coulomb_friction.level": -0.61},
            platform=TRUTH,
        ),
        noise_floor=NoiseFloor(0.0162, SIGMA, "given"),
        per_set=_sets(),
        joint=_genetic("all sets", 9),
        traces=traces,
        holdout_note="No run was declared as held out: the middle fifth of each run was, 10 000 of 50 000 samples.",
        max_error_percent={"inertia": 0.0024, "damping": 0.012, "stiffness": 0.0017},
    )


@cache
def unhappy(duration_s: float = 2.0) -> Identification:
    """Not accepted: a parameter is dropped, another undetermined, the residual stays, no torque figures, odd names."""
    good, _ = sample(duration_s)
    evil = '</script><script>document.title="owned"</script> <b>run</b> & "1"'
    traces = tuple(
        RunTraces(
            **{
                **vars(trace),
                "name": evil,
                "torque_residual_before": None,
                "torque_residual_after": None,
                "torque_nm": None,
                "keep": np.where(np.abs(trace.rate_rad_s) > 0.1, 1.0, 0.0),
                "channel": "angle",
                "measured": np.where(trace.time_s < 0.1, np.nan, trace.angle_rad),
                "simulated_before": trace.angle_rad,
                "simulated_after": trace.angle_rad + 0.001,
            }
        )
        for trace in good.traces[:1]
    )
    nothing = Errors(None, 0.02, None, None, None, None)
    ratios = {"damping_over_inertia": estimate(2.2, 0.01, "1/s")}
    lost = (NotReported("stiffness_over_inertia", "no run returns to rest: record one that does"),)
    return Identification(
        accepted=False,
        reasons=("The residual stays 12 times the noise floor.", "Next: run `free_decay` for 20 s from 5 deg."),
        axis="linear",
        before=ModelResult(ratios, {}, nothing, not_determined=lost),
        verdict=Verdict((), {}, {}, 0.97, True, (), (f"Nothing that was tried explains {evil}.",)),
        after=ModelResult(ratios, {}, nothing, (NotReported("damping", "its interval spans zero"),), lost),
        noise_floor=NoiseFloor(None, 0.0016, "estimated"),
        per_set=(
            SetResult(
                evil, None, {}, float("nan"), 5, False, (), "too short: record at least two periods of the ring", None
            ),
        ),
        joint=None,
        traces=traces,
        holdout_note="Every second stretch was held out.",
        aborted=True,
    )
