"""What `rig init` asks, shows and says of columns of which somebody has to say what they are."""

from __future__ import annotations

from pathlib import Path

from commands.rig.app import app
from commands.rig.init import InitOptions, init
from tests.commands.rig.exported_text import ANGLE, RATE, TIME, TORQUE, rows
from tests.commands.support import command


def test_on_a_terminal_a_unit_that_nobody_can_guess_is_asked_without_a_guess(tmp_path: Path) -> None:
    (tmp_path / "r.csv").write_text("time_s,torque [V],rate_rad_s\n" + rows(TIME, TORQUE / 2, RATE), encoding="utf-8")
    asked: list[str] = []

    def ask(question: str) -> str:
        asked.append(question)
        return "2"

    assert init([tmp_path / "r.csv"], InitOptions({"torque": "torque [V]"}, out=tmp_path / "rig.yaml"), ask) == 0
    assert asked[0].startswith("Unit of 'torque [V]', or factor to SI units? (its numbers are in 'V', which is no unit")
    assert asked[0].endswith(") ") and "guess" not in asked[0]


def test_the_help_gives_units_that_the_quantity_has() -> None:
    text = " ".join(command(app, "init", "--help").stdout.replace("│", " ").split())
    for option, units in (
        ("time", "ms, us"),
        ("torque", "mN m, lbf ft"),
        ("rate", "deg/s, rpm"),
        ("angle", "deg, rev"),
    ):
        assert f"Its unit ({units})" in text.partition(f"--{option}-scale")[2].partition("--")[0]


def test_a_column_that_moves_beside_an_angle_and_may_be_the_rate_is_told(tmp_path: Path) -> None:
    header = "time_s,torque_nm,angle_rad,vitesse [xy],torque_cmd,on,temperature [degC]\n"
    columns = [TIME, TORQUE, ANGLE, RATE, TORQUE, TIME > 0.3, 20 + TIME]
    (tmp_path / "r.csv").write_text(header + rows(*columns), encoding="utf-8")
    done = command(app, "init", tmp_path / "r.csv", "--out", tmp_path / "rig.yaml")
    assert done.exit_code == 0, done.stderr
    said = "no rate is read beside the angle 'angle_rad' (not used, but they move: 'vitesse [xy]'): if one of these is"
    assert said in done.stdout
    done = command(app, "init", tmp_path / "r.csv", "--out", tmp_path / "two.yaml", "--rate", "none")
    assert done.exit_code == 0 and "no rate is read" not in done.stdout
