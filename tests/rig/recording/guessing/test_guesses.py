"""Names, units and numbers say which column is what; where they do not, nobody is told that they do."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rig.errors import RecordingError
from rig.recording.guessing.columns import columns_of
from rig.recording.guessing.roles import Choice, Quantity, guess_roles
from rig.recording.guessing.scales import Factor, axis_of, guess_factors
from rig.recording.table import Table
from rig.recording.tables import DEFAULT_NAMES

T = np.arange(500) * 2e-3
RATE = 3.0 * np.cos(9.0 * T) * np.exp(-0.5 * T) + np.sin(31.0 * T)
ANGLE = np.concatenate([[0.0], np.cumsum(np.diff(T) * (RATE[1:] + RATE[:-1]) / 2)])
TORQUE = np.sin(9.0 * T) + 0.2 * np.cos(70.0 * T)
DEG, RPM = np.pi / 180, np.pi / 30


def table(**columns: np.ndarray) -> Table:
    named = {name.replace("__", " "): values for name, values in columns.items()}
    return Table(Path("r.csv"), tuple(named), lambda names: {n: named[n] for n in names})


def guessed(**columns: np.ndarray) -> tuple[dict[Quantity, Choice], dict[Quantity, Factor]]:
    roles = guess_roles(columns_of(table(**columns)), {})
    return roles, guess_factors(roles, axis_of(roles), {q: list(DEFAULT_NAMES[q]) for q in roles})


def names_of(roles: dict[Quantity, Choice]) -> dict[str, str | None]:
    return {q: choice.column.name if choice.column else None for q, choice in roles.items()}


@pytest.mark.parametrize(
    "names",
    [
        ("t", "tau", "omega", "theta"),
        ("Zeit", "Drehmoment", "Winkelgeschwindigkeit", "Winkel"),
        ("Time", "MotorTorque", "AngularVelocity", "AngularPosition"),
        ("timestamp", "torque_meas", "gyro_z", "encoder"),
        ("elapsed", "actual torque", "angle rate", "angle"),
        ("t", "M", "w", "phi"),
        ("t", "Moment", "Winkelgeschw.", "Lage"),
    ],
)
def test_usual_names_are_known(names: tuple[str, str, str, str]) -> None:
    roles, _ = guessed(**dict(zip(names, (T, TORQUE, RATE, ANGLE), strict=True)))
    assert names_of(roles) == dict(zip(("time", "torque", "rate", "angle"), names, strict=True))
    assert all(choice.sure for choice in roles.values())


def test_the_measured_torque_goes_before_the_commanded_one_and_a_counter_is_no_time() -> None:
    roles, _ = guessed(index=np.arange(500.0), time=T, torque_cmd=TORQUE, torque_actual=TORQUE, speed=RATE)
    assert names_of(roles) == {"time": "time", "torque": "torque_actual", "rate": "speed", "angle": None}


def test_columns_without_a_telling_name_are_parted_by_what_the_numbers_do_and_are_not_sure() -> None:
    roles, factors = guessed(a=T, b=np.degrees(ANGLE), c=TORQUE, d=RATE)
    assert names_of(roles) == {"time": "a", "torque": "c", "rate": "d", "angle": "b"}
    assert not roles["rate"].sure and not roles["angle"].sure and not roles["torque"].sure
    assert factors["angle"].value == pytest.approx(DEG) and factors["rate"].value == 1.0


def test_two_angles_by_name_are_parted_by_which_is_the_derivative() -> None:
    roles, _ = guessed(t=T, torque=TORQUE, theta_a=RATE, theta_b=ANGLE)
    assert names_of(roles) == {"time": "t", "torque": "torque", "rate": "theta_a", "angle": "theta_b"}
    roles, _ = guessed(t=T, torque=TORQUE, theta_a=ANGLE, theta_b=ANGLE + 0.1)
    assert roles["angle"].column is not None and not roles["angle"].sure
    assert "'theta_b' might be" in roles["angle"].why


@pytest.mark.parametrize(
    ("of_angle", "of_rate", "sure"),
    [(DEG, 1.0, True), (1.0, DEG, True), (DEG, RPM, True), (1.0, RPM, True), (1.0, 1.0, False), (DEG, DEG, False)],
)
def test_angle_and_rate_say_each_others_unit(of_angle: float, of_rate: float, sure: bool) -> None:
    _, factors = guessed(t=T, torque=TORQUE, omega=RATE / of_rate, theta=ANGLE / of_angle)
    assert factors["angle"].value == pytest.approx(of_angle)
    assert factors["rate"].value == pytest.approx(of_rate)
    assert (factors["angle"].sure, factors["rate"].sure) == (sure, sure)


def test_a_known_unit_gives_the_other_channels_and_an_opposite_sign_is_said_and_asked() -> None:
    _, factors = guessed(t=T, torque=TORQUE, omega=RATE / RPM, theta_deg=ANGLE / DEG)
    assert factors["rate"] == Factor(pytest.approx(RPM), "rpm, as it agrees with the angle", True)
    _, factors = guessed(t=T, torque=TORQUE, omega=-RATE, theta_deg=ANGLE / DEG)
    assert factors["rate"].value == -1.0 and not factors["rate"].sure
    assert "with the opposite sign" in factors["rate"].why


def test_a_unit_in_the_name_is_taken_and_one_that_is_not_stated_is_asked() -> None:
    _, factors = guessed(time_ms=1e3 * T, torque_mNm=TORQUE, speed_rpm=RATE)
    assert [factors[q].value for q in ("time", "torque", "rate")] == [1e-3, 1e-3, pytest.approx(RPM)]
    assert all(factor.sure for factor in factors.values())
    _, factors = guessed(t=1e3 * T, M=TORQUE, w=np.degrees(RATE))
    assert (factors["time"].value, factors["time"].sure) == (1e-3, False)
    assert (factors["torque"].value, factors["torque"].sure) == (1.0, False)
    assert factors["rate"].value == pytest.approx(DEG) and not factors["rate"].sure


@pytest.mark.parametrize(
    ("name", "shown", "factor"),
    [
        ("torque_mNm", "mNm", 1e-3),
        ("Torque_Nm", "Nm", 1.0),
        ("torque_n_m", "n m", 1.0),
        ("rate_rad_s", "rad/s", 1.0),
        ("timeMs", "ms", 1e-3),
    ],
)
def test_a_unit_in_a_name_is_shown_as_it_is_written(name: str, shown: str, factor: float) -> None:
    column = next(c for c in columns_of(table(**{name: T, "b": T})) if c.name == name)
    assert column.suffix is not None
    assert (column.suffix.text, column.suffix.factor) == (shown, factor)


def test_what_nobody_can_guess_has_no_guess() -> None:
    _, factors = guessed(sample=np.arange(500.0), current=TORQUE, rate_rad_s=RATE)
    assert factors["time"].value is None and not factors["time"].sure
    _, factors = guessed(**{"time_s": T, "current__[A]": TORQUE, "rate_rad_s": RATE})
    assert factors["torque"].value is None and "in 'A'" in factors["torque"].why
    _, factors = guessed(time_s=T, torque_A=TORQUE, gyro_V=RATE)
    assert factors["torque"].value is None and "ends in _A, which may be amperes" in factors["torque"].why
    assert factors["rate"].value is None and "ends in _V, which may be volts" in factors["rate"].why
    _, factors = guessed(t=T, i_q=TORQUE, theta=ANGLE)
    assert factors["torque"].value is None and "by its name it is a current" in factors["torque"].why


def test_a_time_or_a_flag_is_never_a_measured_channel() -> None:
    roles, _ = guessed(**{"torque.Time": T, "torque.Data": TORQUE, "rate.Time": T, "rate.Data": RATE})
    assert names_of(roles) == {"time": "torque.Time", "torque": "torque.Data", "rate": "rate.Data", "angle": None}
    roles, _ = guessed(t=T, M=TORQUE, a=RATE, b=(T > 0.3).astype(float))
    assert names_of(roles)["rate"] == "a"
    roles, _ = guessed(t=T, M=TORQUE, n=RATE, nr=np.arange(500.0))
    assert names_of(roles)["rate"] == "n"


def test_the_q_of_a_current_is_no_angle() -> None:
    roles, _ = guessed(t=T, i_q=TORQUE, theta=ANGLE)
    assert names_of(roles) == {"time": "t", "torque": "i_q", "rate": None, "angle": "theta"}
    roles, _ = guessed(**{"t": T, "torque": TORQUE, "current__position": ANGLE})
    assert names_of(roles)["angle"] == "current position"


def test_of_several_axes_of_a_gyro_the_one_that_moves_most_is_guessed() -> None:
    roles, _ = guessed(t=T, torque=TORQUE, gyro_x=0.01 * TORQUE, gyro_y=RATE, gyro_z=0.01 * RATE)
    assert names_of(roles)["rate"] == "gyro_y" and not roles["rate"].sure
    assert "'gyro_x', 'gyro_z' might be" in roles["rate"].why
    wrench = {"force.x__[N]": 0 * T, "force.z__[N]": 0 * T, "torque.x__[Nm]": 0 * T, "torque.z__[Nm]": TORQUE}
    roles, _ = guessed(**{"time_s": T, "rate_rad_s": RATE, **wrench})
    assert names_of(roles)["torque"] == "torque.z [Nm]"


def test_a_unit_of_something_else_and_a_name_of_something_else_are_not_sure() -> None:
    roles, _ = guessed(**{"time": T, "torque__[deg]": ANGLE, "angle__[Nm]": TORQUE})
    assert names_of(roles) == {"time": "time", "torque": "angle [Nm]", "rate": None, "angle": "torque [deg]"}
    assert not roles["torque"].sure and "though its name says angle" in roles["torque"].why
    roles, factors = guessed(**{"[s]": T, "[Nm]": TORQUE, "[deg/s]": RATE})
    assert names_of(roles) == {"time": "[s]", "torque": "[Nm]", "rate": "[deg/s]", "angle": None}
    assert all(factor.sure for factor in factors.values())


def test_volts_behind_in_are_no_torque_and_no_rate() -> None:
    roles, factors = guessed(**{"in__s": T, "C1__in__V": TORQUE, "C2__in__V": RATE})
    assert names_of(roles) == {"time": "in s", "torque": None, "rate": None, "angle": None}
    assert not roles["torque"].sure and factors["time"].sure


def test_a_linear_axis_is_known_by_its_units() -> None:
    roles, factors = guessed(t_s=T, force_N=TORQUE, position_mm=1e3 * ANGLE)
    assert axis_of(roles) == "linear"
    assert factors["angle"].value == 1e-3 and factors["torque"].value == 1.0


def test_without_two_columns_of_numbers_the_file_is_refused_with_the_reasons() -> None:
    with pytest.raises(RecordingError, match=r"fewer than two columns of numbers.*'b', 'c': has 3 numbers$"):
        columns_of(table(a=T, b=np.where(np.arange(500) < 3, T, np.nan), c=np.where(np.arange(500) < 3, T, np.nan)))
