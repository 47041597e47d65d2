"""Further measured channels as candidate causes: which a recording offers, and which of them can be one at all."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from identify.results import Candidate
from identify.signals.channel_readings import table_of
from identify.signals.trace import UPSAMPLING, Trace
from identify.wording import joined, number, plain
from rig import effects
from rig.channels import Channel
from rig.config.channels import ChannelConfig
from rig.errors import RecordingError
from rig.platform import Platform
from rig.recording.run import Array, Run

MAX_OWN_MOTION_SHARE = 0.999  # of a channel, explained by angle, rate and acceleration: it is the platform's own motion
CONSTANT_TOLERANCE = 1e-9  # of its largest reading: a channel that moves by less does not move
MIN_CURRENT_SHARE = 0.05  # of the largest current: below, its noise is what the ratio shows
REFUSED = "refused: "  # how the status of such a candidate begins


@dataclass(frozen=True)
class Offer:
    """What the channels of a recording bring to the search.

    Attributes
    ----------
    candidates
        Effects that may be tried.
    refused
        Those that may not, with the reason in their status.
    idle
        Effects of the declared model that these runs do not show, with the reason: a channel that does not move.
    """

    candidates: tuple[str, ...] = ()
    refused: tuple[Candidate, ...] = ()
    idle: tuple[tuple[str, str], ...] = ()


def simplicity(name: str) -> int:
    """Zero for an effect that needs no sensor of its own, which goes first among candidates that do as well."""
    return 0 if effects.get(name).reads is None else 1


def with_causes(runs: Sequence[Run], declared: Platform, asked: Mapping[str, ChannelConfig]) -> list[Run]:
    """The runs with all causes of the campaign, as one and the same channel in each; their effects are made known.

    Parameters
    ----------
    declared
        The declared model: where it reads a channel, its reference stands.
    asked
        ``identify.channels``.

    Raises
    ------
    RecordingError
        Where the declared model reads a channel that a run does not have, or has as something else.
    """
    known = {name: c for run in runs for name, c in run.causes.items()}
    known |= {name: config.channel(name) for name, config in asked.items()}
    _check_offered(runs, declared, known)
    if not known and not declared.channels:
        return list(runs)
    given = declared.channels
    known |= {name: c for name, c in given.items() if name not in known and any(name in r.channels for r in runs)}
    settled = {}
    for name, channel in known.items():
        before = given.get(name, channel)
        reference = before.reference if before.reference is not None else channel.reference
        factor = before.factor if before.factor is not None else channel.factor
        settled[name] = _settled(replace(channel, reference=reference, factor=factor), runs)
    effects.declare_channels(settled.values())
    return [replace(run, causes={n: c for n, c in settled.items() if n in run.channels}) for run in runs]


def _check_offered(runs: Sequence[Run], declared: Platform, known: Mapping[str, Channel]) -> None:
    for name in declared.effects:
        channel = effects.get(name).reads
        if channel is None:
            continue
        for run in runs:
            if channel.name not in run.channels:
                raise RecordingError(
                    f"model.effects.{name} reads the channel {channel.name!r}, which {run.name} does not have: declare "
                    f"it (recorded.columns.channels.{channel.name}), or take {name} out of the model"
                )
        kind = declared.channels[channel.name].kind if channel.name in declared.channels else channel.kind
        if channel.name in known and known[channel.name].kind != kind:
            raise RecordingError(
                f"model.channels.{channel.name}.kind is {kind}, but the recording declares it as "
                f"{known[channel.name].kind}: give both the same kind"
            )


def _settled(channel: Channel, runs: Sequence[Run]) -> Channel:
    """A channel with its reference, and the torque of an ampere where it is a current."""
    if channel.reference is None:
        first = next((r for r in runs if channel.name in r.channels), None)
        reference = 0.0
        if not channel.nature.from_zero and first is not None:
            table, _ = table_of(first, channel, float(np.median(np.diff(first.time_s))))
            reference = float(table[0])
        channel = replace(channel, reference=reference)
    if channel.kind != "current":
        return replace(channel, factor=1.0)
    return channel if channel.factor is not None else replace(channel, factor=_torque_of_an_ampere(channel, runs))


def _torque_of_an_ampere(channel: Channel, runs: Sequence[Run]) -> float:
    """The median of the recorded torque over the current: a sag in less than half of the samples bends nothing."""
    pairs = []
    for run in runs:
        if run.torque_nm is None or run.torque_time_s is None or channel.name not in run.channels:
            continue
        x = run.channels[channel.name] - (channel.reference or 0.0)
        ok = np.isfinite(x)
        pairs.append((x[ok], np.interp(run.time_s[ok], run.torque_time_s, run.torque_nm)))
    if not pairs:
        return 0.0
    x, torque = (np.concatenate(parts) for parts in zip(*pairs, strict=True))
    plain = np.abs(x) > MIN_CURRENT_SHARE * float(np.max(np.abs(x), initial=0.0))
    return float(np.median(torque[plain] / x[plain])) if plain.any() else 0.0


def offer_of(traces: Sequence[Trace], declared: Platform, asked: Iterable[str] = ()) -> Offer:
    """Which effects of channels may be tried on these runs, and why the others may not.

    ``asked`` are the names in ``identify.channels``, which the runs need not have.
    """
    channels: dict[str, Channel] = {}
    for trace in traces:
        channels |= trace.run.causes
    candidates: list[str] = []
    refused: list[Candidate] = []
    idle: list[tuple[str, str]] = []
    for channel in channels.values():
        why = _why_not(channel, traces)
        for name in effects.of_channel(channel.name):
            reason = why.get("drive" if name.endswith("_drive") else "", "")
            if not reason:
                candidates.append(name)
            elif name in declared.effects and why.get("still"):
                idle.append((name, reason))
            else:
                refused.append(Candidate(name, 0, 0.0, None, f"{REFUSED}{reason}"))
    there = joined(sorted({n for t in traces for n in t.run.channels})) or "none"
    for name in (n for n in asked if n not in channels):
        status = f"{REFUSED}no run has a channel {name!r}; there are: {there} (recorded.columns.channels)"
        refused.extend(Candidate(effect, 0, 0.0, None, status) for effect in effects.of_channel(name))
    return Offer(tuple(candidates), tuple(refused), tuple(idle))


def _why_not(channel: Channel, traces: Sequence[Trace]) -> dict[str, str]:
    """Why a channel is no cause: of a drive ("drive"), in all other ways (""); "still" where it does not move."""
    name = plain(channel.name)
    without = [t.run.name for t in traces if channel.name not in t.run.causes]
    if without:
        why = f"{without[0]} has no {name}; the channel is needed in every run"
        return {"": why, "drive": why}
    acting = [_at_samples(channel, t) for t in traces]
    largest = max(float(np.max(np.abs(t.run.channels[channel.name]), initial=0.0, where=np.isfinite(
        t.run.channels[channel.name]))) for t in traces)  # fmt: skip
    if max(float(np.max(a)) for a in acting) - min(float(np.min(a)) for a in acting) <= CONSTANT_TOLERANCE * max(
        largest, 1e-300
    ):
        at = (channel.reference or 0.0) + float(acting[0][0]) / (channel.factor or 1.0)
        why = f"{name} is constant at {number(at, 5)} in all runs; J, C and K hold for that value"
        return {"": why, "drive": why, "still": why}
    share = _own_share(acting, traces)
    if share <= MAX_OWN_MOTION_SHARE:
        return {}
    percent = number(100.0 * share, 5)
    return {"": f"{percent} % of {name} is the platform's own motion (its angle, rate and acceleration) in these runs"}


def _at_samples(channel: Channel, trace: Trace) -> Array:
    """factor * (x - reference) at the samples of a trace."""
    table, per_s, _begin_s = trace.table(channel)
    time = trace.offset_s + trace.step_s * np.arange(len(trace.measured))
    return np.interp(time, np.arange(len(table)) / per_s, table)


def _own_share(acting: Sequence[Array], traces: Sequence[Trace]) -> float:
    """Share of a channel's square that angle, rate, acceleration and one constant explain, all runs together."""
    rows, values = [], []
    for x, trace in zip(acting, traces, strict=True):
        angle, rate, time, _torque, _left = trace.fine
        acceleration = np.gradient(rate, time)
        motion = np.stack([angle, rate, acceleration], axis=1)[::UPSAMPLING]
        constant = np.ones((len(motion), 1))
        rows.append(np.hstack([motion, constant])[trace.keep])
        values.append(x[trace.keep])
    m, x = np.concatenate(rows), np.concatenate(values)
    size = np.sqrt(np.mean(m**2, axis=0)) + 1e-300
    left = x - m / size @ np.linalg.lstsq(m / size, x, rcond=1e-12)[0]
    spread = float(np.sum((x - np.mean(x)) ** 2))
    return 1.0 - float(left @ left) / spread if spread > 0.0 else 0.0
