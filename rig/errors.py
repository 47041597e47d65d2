"""The one tree of exceptions, and the exit code that each branch ends in.

    RigError (70: internal unless a branch says otherwise)
    |- UsageError (2)          bad command line, config, recording, or a pre-flight refusal
    |  |- ConfigError          a key of rig.yaml: file, line, key, value, what is allowed
    |  |- RecordingError       a recording that cannot be read or trusted
    |  |- InputError           arguments of a call from Python that cannot be used; also a ValueError
    |  |- MissingPackage       an optional package that is not installed; also an ImportError
    |  `- PreflightRefusal     the campaign would break a limit; nothing moved
    |- DeviceFault (3)         a device failed, vanished or never answered
    |- SafetyTrip (4)          a limit was broken while playing; torque is off
    `- Aborted (130)           Ctrl-C or a signal

Every message says what happened, the value, the limit and what to do: it is read at the bench.
"""

from __future__ import annotations

from typing import ClassVar


class RigError(Exception):
    """Base of all errors that the commands turn into a message and an exit code."""

    exit_code: ClassVar[int] = 70


class UsageError(RigError):
    """The request itself cannot be carried out; nothing was moved or written."""

    exit_code = 2


class ConfigError(UsageError):
    """One or more keys of a configuration file are wrong."""


class RecordingError(UsageError):
    """A recording cannot be read, or what it holds cannot be trusted."""


class InputError(UsageError, ValueError):
    """Arguments of a call from Python cannot be used, or what they hold cannot be trusted."""


class MissingPackage(UsageError, ImportError):
    """A call from Python needs an optional package that is not installed."""


class PreflightRefusal(UsageError):
    """The campaign would break a limit, or its devices are not ready.

    ``keys`` are those of the configuration that say what is allowed, as far as one of them does.
    """

    keys: tuple[str, ...] = ()


class DeviceFault(RigError):
    """A device failed, vanished or answered nonsense; torque is off."""

    exit_code = 3


class SafetyTrip(RigError):
    """A guard tripped; torque is off and what was recorded is kept."""

    exit_code = 4


class Aborted(RigError):
    """The operator or the system asked to stop."""

    exit_code = 130
