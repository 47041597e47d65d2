"""Options that several commands share, declared once."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from commands.terminal.plain_flags import App, PlainGroup

ConfigFile = Annotated[Path, typer.Argument(metavar="CONFIG", help="The rig.yaml to work from.", show_default=False)]
Out = Annotated[
    Path | None,
    typer.Option(metavar="DIR", help="Results folder; never overwritten. Default: runs/<UTC time>-<config name>/"),
]
Resume = Annotated[
    Path | None,
    typer.Option(metavar="DIR", help="Play only the sets that the campaign in DIR did not finish; DIR stays as it is."),
]
DryRun = Annotated[bool, typer.Option("--dry-run", help="Play the campaign on the simulated rig; nothing moves.")]
Emulate = Annotated[bool, typer.Option("--emulate", help="Bench drivers on emulated devices; nothing moves.")]
Live = Annotated[
    bool, typer.Option("--live", help="Serve a page on this machine that shows the campaign and has a stop button.")
]
Yes = Annotated[
    bool, typer.Option("--yes", help="Apply REAL torque without asking; a follow-up only if the file says auto.")
]
Overrides = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="A.B.C=VALUE", help="Override one key of CONFIG; may be repeated."),
]
Seed = Annotated[int | None, typer.Option(metavar="N", min=0, max=2**32 - 1, help="Seed of simulation and search.")]
Quiet = Annotated[
    bool, typer.Option("--quiet", help="Print only errors and warnings (REAL torque, code from files, low disk space).")
]

TimeColumn = Annotated[str | None, typer.Option(metavar="COL", help="Column of the time.")]
TorqueColumn = Annotated[str | None, typer.Option(metavar="COL", help="Column of the torque; none: a free decay.")]
RateColumn = Annotated[str | None, typer.Option(metavar="COL", help="Column of the rate; none: not measured.")]
AngleColumn = Annotated[str | None, typer.Option(metavar="COL", help="Column of the angle; none: not measured.")]

_SCALE = "Its unit ({}), or the factor to SI units."
TimeScale = Annotated[str | None, typer.Option(metavar="FACTOR", help=_SCALE.format("ms, us"))]
TorqueScale = Annotated[str | None, typer.Option(metavar="FACTOR", help=_SCALE.format("mN m, lbf ft"))]
RateScale = Annotated[str | None, typer.Option(metavar="FACTOR", help=_SCALE.format("deg/s, rpm"))]
AngleScale = Annotated[str | None, typer.Option(metavar="FACTOR", help=_SCALE.format("deg, rev"))]


def new_app(help_text: str) -> typer.Typer:
    """An application whose errors are ours to say; it completes lines in a shell that was told to ask it."""
    return App(
        help=help_text,
        cls=PlainGroup,
        pretty_exceptions_enable=False,
        context_settings={"help_option_names": ["-h", "--help"]},
    )


def show_version(wanted: bool) -> None:
    """Print the version and exit."""
    if wanted:
        from commands.terminal.version import version

        typer.echo(f"isp-rig {version()}")
        raise typer.Exit


Version = Annotated[
    bool, typer.Option("--version", callback=show_version, is_eager=True, help="Print the version and exit.")
]
