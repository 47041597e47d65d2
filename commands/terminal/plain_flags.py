"""Typer's commands with flags that look like flags: `--quiet`, not `--quiet <bool>`."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import typer
from typer.core import TyperCommand, TyperGroup


def _without_type(parameters: list[Any]) -> list[Any]:
    """The same parameters; a flag, which takes no value, says no type of one."""
    for parameter in parameters:
        if getattr(parameter, "is_flag", False) and parameter.metavar is None:
            parameter.metavar = ""
    return parameters


class PlainCommand(TyperCommand):
    """A command; its `--help`, which Typer makes itself, is a flag like any other."""

    def get_params(self, ctx: Any) -> Any:
        """All parameters, with the one for help."""
        return _without_type(super().get_params(ctx))


class PlainGroup(TyperGroup):
    """A command with subcommands."""

    def get_params(self, ctx: Any) -> Any:
        """All parameters, with the one for help."""
        return _without_type(super().get_params(ctx))


class App(typer.Typer):
    """An application all of whose commands are plain ones."""

    def command(self, name: str | None = None, **settings: Any) -> Callable[[Any], Any]:
        """As of Typer."""
        return super().command(name, **({"cls": PlainCommand} | settings))
