"""The command `rig` and its subcommands."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from commands.campaign.context import CommandContext, Options, run_command
from commands.terminal.exit_codes import run_to_exit_code
from commands.terminal.options import (
    AngleColumn,
    AngleScale,
    ConfigFile,
    DryRun,
    Emulate,
    Out,
    Overrides,
    Quiet,
    RateColumn,
    RateScale,
    Resume,
    Seed,
    TimeColumn,
    TimeScale,
    TorqueColumn,
    TorqueScale,
    Version,
    Yes,
    new_app,
)

RECORDINGS = (
    "Recordings of the same columns, one a run: CSV (also .tsv, .txt, .lvm, .csv.gz), JSON, NPZ, MAT, HDF5; as extras "
    "Parquet, Excel, MDF4, TDMS, ROS bags. None: a bench."
)
ResultsDir = Annotated[
    Path, typer.Argument(metavar="DIR", help="The results folder of a campaign.", show_default=False)
]

EffectFiles = Annotated[
    list[Path] | None,
    typer.Option("--effects", metavar="FILE", help="A file with effects of your own, whose code is run; repeatable."),
]

app = new_app("Prepare, check and play a campaign on the rig; identify-run identifies the parameters.")


@app.callback()
def rig(version: Version = False) -> None:
    """Prepare, check and play a campaign on the rig; identify-run identifies the parameters."""


@app.command()
def check(config: ConfigFile, emulate: Emulate = False, overrides: Overrides = None) -> None:
    """Validate CONFIG, forecast every set, contact the devices without torque; list every fault with its cure."""

    def command(context: CommandContext) -> int:
        loaded = context.options.load()
        from commands.rig.check import run_checks

        return run_checks(context, loaded)

    raise typer.Exit(run_command(Options(config, emulate=emulate, overrides=tuple(overrides or ())), command))


@app.command()
def devices() -> None:
    """List the serial ports and CAN adapters of this machine."""

    def command() -> int:
        from commands.rig.devices import device_lines

        sys.stdout.write("\n".join(device_lines()) + "\n")
        return 0

    raise typer.Exit(run_to_exit_code(command))


@app.command()
def play(
    config: ConfigFile,
    out: Out = None,
    dry_run: DryRun = False,
    emulate: Emulate = False,
    yes: Yes = False,
    overrides: Overrides = None,
    seed: Seed = None,
    quiet: Quiet = False,
    resume: Resume = None,
) -> None:
    """Play and record only."""

    def command(context: CommandContext) -> int:
        loaded = context.options.load()
        from commands.rig.play import play_only

        return play_only(context, loaded)

    options = Options(config, out, dry_run, emulate, yes, tuple(overrides or ()), seed, quiet, resume)
    raise typer.Exit(run_command(options, command))


@app.command()
def prove(
    folder: ResultsDir,
    dry_run: DryRun = False,
    emulate: Emulate = False,
    yes: Yes = False,
    rival: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="Also compensate this alternative, to see which leaves the smaller error."),
    ] = None,
    seed: Seed = None,
    quiet: Quiet = False,
) -> None:
    """Cancel the named effects on the rig and measure the remaining error.

    Refuted effects are excluded and the search is repeated.

    Exit codes: 0 all names confirmed (but those too small to be seen), 1 not all, 2 wrong usage or forecast, 3 device
    fault, 4 safety trip, 70 internal error, 130 Ctrl-C.
    """

    def command(context: CommandContext) -> int:
        from commands.rig.prove import prove_folder

        return prove_folder(context, folder, rival)

    options = Options(folder, None, dry_run, emulate, yes, (), seed, quiet)
    raise typer.Exit(run_command(options, command))


@app.command()
def recover(
    folder: ResultsDir,
) -> None:
    """Recover the results folder of a campaign that was killed or lost power; existing files are not changed."""

    def command() -> int:
        from commands.rig.recover import recover_folder

        return recover_folder(folder)

    raise typer.Exit(run_to_exit_code(command))


@app.command()
def export(
    source: Annotated[
        Path, typer.Argument(metavar="FROM", help="A results folder, recording.h5 or journal.", show_default=False)
    ],
    to: Annotated[
        str,
        typer.Option(
            metavar="FORMAT",
            help="csv, mat or npz: the runs; blf, asc or mf4: the CAN log; model-json, model-mat or modelica: the "
            "identified model; compensation (or C, python, table): the compensating torque as C, Python and a table.",
        ),
    ],
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="A folder that does not exist yet. Default: FROM/export_FORMAT/")
    ] = None,
    effects: EffectFiles = None,
) -> None:
    """Write a recording (with a rig.yaml that reads it back), the identified model or a compensation.

    All numbers are at full precision.
    """

    def command() -> int:
        from commands.rig.export import export_recording

        return export_recording(source, to, out, effects or [])

    raise typer.Exit(run_to_exit_code(command))


@app.command()
def report(
    folder: ResultsDir,
    effects: EffectFiles = None,
) -> None:
    """Rebuild report.html of a results folder."""

    def command() -> int:
        from commands.rig.report import rebuild

        return rebuild(folder, effects or [])

    raise typer.Exit(run_to_exit_code(command))


@app.command()
def compare(
    a: Annotated[Path, typer.Argument(metavar="A", help="A results folder.", show_default=False)],
    b: Annotated[Path, typer.Argument(metavar="B", help="The results folder to compare with A.", show_default=False)],
    out: Annotated[
        Path | None, typer.Option(metavar="FILE.html", help="Write the comparison as a page, too; never overwritten.")
    ] = None,
) -> None:
    """Compare two results folders: what changed, and whether by more than both 95 % intervals."""

    def command() -> int:
        from commands.rig.compare import compare_folders

        return compare_folders(a, b, out)

    raise typer.Exit(run_to_exit_code(command))


@app.command()
def schema() -> None:
    """Print the JSON schema of rig.yaml, for completion and checks in an editor."""

    def command() -> int:
        from commands.rig.schema import print_schema

        return print_schema()

    raise typer.Exit(run_to_exit_code(command))


@app.command()
def init(
    sources: Annotated[list[Path] | None, typer.Argument(metavar="FILE", help=RECORDINGS, show_default=False)] = None,
    time: TimeColumn = None,
    torque: TorqueColumn = None,
    rate: RateColumn = None,
    angle: AngleColumn = None,
    time_scale: TimeScale = None,
    torque_scale: TorqueScale = None,
    rate_scale: RateScale = None,
    angle_scale: AngleScale = None,
    sample_rate: Annotated[
        str | None, typer.Option(metavar="HZ", help="Rows a second of a file without a time.", show_default=False)
    ] = None,
    axis: Annotated[str | None, typer.Option(metavar="AXIS", help="rotary or linear. Default: by the units.")] = None,
    out: Annotated[Path, typer.Option(metavar="FILE", help="Where to write; never over a file.")] = Path("rig.yaml"),
    yes: Annotated[bool, typer.Option("--yes", help="Accept all guesses and list them.")] = False,
) -> None:
    """Write a commented rig.yaml: from the columns of a recording, or from the ports of this machine."""

    def command() -> int:
        from commands.rig.init import InitOptions, expanded, init
        from commands.rig.init_questions import terminal

        columns = (time, torque, rate, angle), (time_scale, torque_scale, rate_scale, angle_scale)
        return init(expanded(sources or []), InitOptions.of(*columns, axis, out, yes, sample_rate), terminal())

    raise typer.Exit(run_to_exit_code(command))


@app.command()
def emulate(config: ConfigFile, overrides: Overrides = None) -> None:
    """Emulate the devices of CONFIG's `bench` section at wire level until Ctrl-C; JSON lines say what they do.

    A JSON line on standard input makes a fault occur: {"fault": "gyro_silent", "lasts_s": 0.2}.
    """

    def command() -> int:
        from commands.rig.emulate import emulate_devices

        return emulate_devices(Options(config, emulate=True, overrides=tuple(overrides or ())))

    raise typer.Exit(run_to_exit_code(command))
