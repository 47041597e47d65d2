"""What every playing or identifying command needs: options, terminal, stop requests, results folder."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from commands.live.view import NoLiveView
from commands.terminal.exit_codes import report, run_to_exit_code, say
from commands.terminal.stop_requests import StopRequests

if TYPE_CHECKING:
    from commands.campaign.results_folder import ResultsFolder
    from commands.terminal.display import Terminal
    from rig.config.load import LoadedConfig


@dataclass(frozen=True)
class Options:
    """What was asked for on the command line."""

    config: Path
    out: Path | None = None
    dry_run: bool = False
    emulate: bool = False
    yes: bool = False
    overrides: tuple[str, ...] = ()
    seed: int | None = None
    quiet: bool = False
    resume: Path | None = None
    live: bool = False

    def load(self) -> LoadedConfig:
        """The checked configuration, --set and --seed applied; code that it runs is said first. Raises ConfigError."""
        from commands.campaign.backends import EMULATED, SIMULATED
        from commands.campaign.device_settings import device_faults
        from rig.config.load import load_config

        played_on = SIMULATED if self.dry_run else EMULATED if self.emulate else "bench"
        seeds = [] if self.seed is None else [f"simulated.seed={self.seed}", f"identify.seed={self.seed}"]
        also_wrong = partial(device_faults, played_on=played_on)
        return load_config(self.config, [*self.overrides, *seeds], also_wrong, announce=say)


@dataclass
class CommandContext:
    """One command at work."""

    options: Options
    terminal: Terminal
    stops: StopRequests
    folder: ResultsFolder | None = None
    live: NoLiveView = field(default_factory=NoLiveView)

    def note(self, text: str) -> None:
        """Say on the terminal and on the live page what is being worked on."""
        self.terminal.note(text)
        self.live.note(text)

    def choose_folder(self, name: str) -> ResultsFolder:
        """Name the results folder; nothing is made yet. Raises UsageError where --out exists."""
        from commands.campaign.results_folder import ResultsFolder

        self.folder = ResultsFolder(self.options.out, name, datetime.now(UTC))
        return self.folder

    def existing_path(self) -> Path | None:
        """The results folder as far as there is one."""
        return self.folder.existing_path() if self.folder is not None else None

    def say_error(self, error: BaseException) -> int:
        """Say on stderr what went wrong, without ending here; returns the exit code it stands for."""
        self.terminal.flush()
        return report(error, self.existing_path())


def run_command(options: Options, command: Callable[[CommandContext], int]) -> int:
    """Run a command with signals heeded; returns the exit code. Never raises."""
    stops = StopRequests()
    context: CommandContext | None = None

    def work() -> int:
        nonlocal context
        with stops.handling_signals():
            from commands.terminal.display import Terminal

            context = CommandContext(options, Terminal(sys.stderr, options.quiet), stops)
            stops.show, context.terminal.on_loss = context.terminal.show, stops.request
            with context.terminal.writing():
                return command(context)

    return run_to_exit_code(
        work, lambda: context.existing_path() if context is not None else None, lambda: stops.reason
    )
