"""A run made ready for the fit: uniform time, the measured channel, smoothed motion, usable stretches."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np
from scipy.interpolate import CubicSpline

from identify.model.effect_torque import torque_along
from identify.signals.low_pass import drift_between
from identify.signals.noise import is_noise, noise_of, rounding_of
from identify.signals.prefilter import held_pieces, linear_pieces, smooth_pieces
from rig import effects
from rig.channels import Channel
from rig.dynamics import TorqueSignal
from rig.dynamics.equations import MAX_SUBSTEPS, slots
from rig.dynamics.filters import run_filter
from rig.dynamics.native import addresses
from rig.dynamics.polynomials import Polynomials
from rig.effects.base import Effect, Place
from rig.recording.run import Array, Run

MOTION_FILTER_ORDER = 3  # Butterworth, run forwards and backwards: of the sixth order in all; set by hand
UPSAMPLING = 4  # nonlinear torques have corners between samples
SHORTEST_STRETCH = 40  # samples; a shorter one costs more in start states than it tells
LEAD_S = 0.1  # of torque ahead of a piece of a run, for a drive with memory
KEPT_SAMPLES = 4_000_000  # of the torques that a run keeps: 64 bytes each
RUNAWAY_TORQUE = 1e100  # torque of an effect along a noisy motion, in any unit: it was integrated beyond all bounds
MOST_WALK = 0.01  # of the rate, that a gyro's bias walks over a run
MOST_BIAS_RAD_S = 0.05  # of a gyro: what its integral runs away faster with is the motion itself
COARSE_STEP_PHASE_RAD = 0.1  # coarser than the simulator's: these torques only start a search


@dataclass
class Trace:
    """One run on a uniform grid of n samples.

    Attributes
    ----------
    channel
        "rate" (gyro) or "angle" (encoder): what is predicted, and whose noise is white.
    measured
        Shape (n,): that channel, small gaps bridged (they carry no weight).
    keep
        Shape (n,): samples that count.
    stretches
        First and last sample of each contiguous usable stretch; its start state is free.
    """

    run: Run
    channel: Literal["rate", "angle"]
    step_s: float
    measured: Array
    keep: Any
    stretches: list[tuple[int, int]]
    torque: TorqueSignal | None
    noise: float
    cutoff_hz: float  # of the zero-phase low-pass behind ``fine``
    number: int = 0  # which run of the recording
    offset_s: float = 0.0  # of the first sample from where the torque of the run is known
    glitches_s: Array = field(default_factory=lambda: np.zeros(0))  # times of samples left out as such
    clipped: tuple[int, float] = (0, 0.0)  # samples left out because the gyro stood at its largest rate, and that
    scatter: tuple[float, bool] = (0.0, False)  # of the time stamps about an even beat in s; whether they are wrong
    motion: tuple[Array, Array, Array, Array, float] | None = None  # of a piece: cut out of the whole run's
    beside: Array | None = None  # (n,): the other channel, where an encoder and a gyro read independently of each other
    beside_noise: float = 0.0
    drift_rad: Array | None = None  # (n,): of the integrated rate, where a spring tells it
    torque_is_filtered: bool = False  # of its noise: what is left of that lies around the torque's own frequencies
    _series: dict[Any, Any] = field(default_factory=dict)
    _tables: dict[Channel, tuple[Array, float]] = field(default_factory=dict)  # shared by the pieces of a run

    @property
    def start_s(self) -> float:
        """Time stamp of the first sample."""
        return float(self.run.time_s[0]) + self.offset_s

    @property
    def since_start_s(self) -> float:
        """Of the first sample from the start of the run, of which this may be an excerpt: the time that effects see."""
        return self.offset_s + self.run.since_start_s

    @cached_property
    def upper_spectrum(self) -> tuple[float, bool]:
        """The noise that the end of this run's spectrum shows, and whether it is noise and not motion up there."""
        first, last = max(self.stretches, key=lambda ab: ab[1] - ab[0], default=(0, len(self.measured) - 1))
        values = self.measured[first : last + 1]
        return noise_of(values), bool(rounding_of(values)) or is_noise(values)

    def piece(self, first: int, last: int) -> Trace:
        """Samples first..last as a trace of their own."""
        angle, rate, time, torque, left = self.fine
        fine = slice(first * UPSAMPLING, last * UPSAMPLING + 1)
        inside = ((max(a, first) - first, min(b, last) - first) for a, b in self.stretches)
        return replace(
            self,
            measured=self.measured[first : last + 1],
            keep=self.keep[first : last + 1],
            beside=None if self.beside is None else self.beside[first : last + 1],
            drift_rad=None if self.drift_rad is None else self.drift_rad[first : last + 1],
            stretches=[(a, b) for a, b in inside if b - a + 1 >= SHORTEST_STRETCH],
            offset_s=self.offset_s + first * self.step_s,
            motion=(angle[fine], rate[fine], time[fine], torque[fine], left),
            _series={},
        )

    def table(self, channel: Channel) -> tuple[Array, float, float]:
        """What a channel does, finer than the samples, the entries a second, and when in the run the first one is."""
        if channel not in self._tables:
            from identify.signals.channel_readings import table_of  # noqa: PLC0415  as below

            self._tables[channel] = table_of(self.run, channel, self.step_s)
        return *self._tables[channel], self.run.since_start_s

    @property
    def low_pass(self) -> tuple[float, float] | None:
        """Corner in Hz and delay in s of the gyro's own low-pass, where one is read and its data sheet says them."""
        corner_hz, delay_s = self.run.rate_corner_hz, self.run.rate_delay_s
        by_gyro = self.channel == "rate" or self.beside is not None
        return (corner_hz, delay_s) if by_gyro and corner_hz and delay_s else None

    @property
    def biased(self) -> bool:
        """Whether the channel may carry an unknown constant: a gyro alone; an encoder beside it would show it."""
        return self.channel == "rate" and self.run.angle_rad is None

    @cached_property
    def largest_bias_rad_s(self) -> float:
        """What a gyro's bias is no larger than: a spring lets no rate stay, and what turns on has a larger mean."""
        return max(MOST_BIAS_RAD_S, 2.0 * abs(float(np.mean(self.measured))))

    @property
    def travel_deg(self) -> float:
        """How far the platform goes to either side of where it mostly is, what a gyro's bias adds left out."""
        angle, time = self.fine[0][::UPSAMPLING], self.fine[2][::UPSAMPLING]
        slopes = [0.0]
        if self.biased and len(angle) > 2:
            slope = float(np.polynomial.Polynomial.fit(time, angle, 1).convert().coef[-1])
            slopes.append(min(max(slope, -MOST_BIAS_RAD_S), MOST_BIAS_RAD_S))
        level = [angle - slope * time for slope in slopes]  # an even swing may have a slope of its own
        return float(np.degrees(min(np.max(np.abs(x - np.median(x)), initial=0.0) for x in level)))

    @property
    def count(self) -> int:
        """Number of samples that count."""
        return int(np.sum(self.keep))

    @cached_property
    def measured_pieces(self) -> Array:
        """The measured channel as a cubic spline."""
        return smooth_pieces(self.measured, self.step_s)

    @cached_property
    def fine(self) -> tuple[Array, Array, Array, Array, float]:
        """Angle, rate, time and torque, upsampled and smoothed, and the noise left in the rate."""
        if self.motion is not None:
            return self.motion
        wn, y = 2.0 * self.cutoff_hz * self.step_s, self.measured
        if wn < 0.8:
            from scipy import signal  # noqa: PLC0415  slow to load: a forecast knows its motion

            sos = signal.butter(MOTION_FILTER_ORDER, wn, output="sos")
            y = signal.sosfiltfilt(sos, y, padlen=min(len(y) - 1, int(10.0 / wn)))
        t = self.step_s * np.arange(len(y))
        fine_t = self.step_s / UPSAMPLING * np.arange((len(y) - 1) * UPSAMPLING + 1)
        spline = CubicSpline(t, y)
        if self.channel == "rate":
            angle, rate = Polynomials(spline.antiderivative())(fine_t), Polynomials(spline)(fine_t)
            left = self.noise * np.sqrt(min(1.0, wn))
            angle = angle + np.interp(fine_t, t, self.put_right(angle[::UPSAMPLING], t) - angle[::UPSAMPLING])
        else:
            angle, rate = Polynomials(spline)(fine_t), Polynomials(spline.derivative())(fine_t)
            left = self.noise * 2.0 * np.pi * self.cutoff_hz / np.sqrt(3.0) * np.sqrt(min(1.0, wn))
        torque = np.zeros_like(fine_t) if self.torque is None else self.torque.at(fine_t + self.start_s)
        return angle, rate, fine_t + self.since_start_s, torque, float(left)

    def put_right(self, angle_rad: Array, time_s: Array) -> Array:
        """An angle integrated from the rate, (n,), where an encoder reads it or the spring holds it."""
        return angle_rad + self._offset(angle_rad, time_s) - (0.0 if self.drift_rad is None else self.drift_rad)

    def _offset(self, angle_rad: Array, time_s: Array) -> Array | float:
        """By how much an encoder reads more, (n,): a gyro has not seen what turned while readings were lost."""
        run = self.run
        if run.angle_rad is None:
            return 0.0
        ok = run.valid & np.isfinite(run.angle_rad)
        encoder = np.interp(time_s + self.start_s, run.time_s[ok], run.angle_rad[ok])
        noise = max(noise_of(encoder), rounding_of(run.angle_rad[ok]) or 0.0)
        return drift_between(encoder, angle_rad, self.measured, self.step_s, self.stretches, noise)

    @cached_property
    def bend_rad_s3(self) -> float:
        """Second derivative of the rate, root mean square."""
        return float(np.sqrt(np.mean((np.diff(self.fine[1], 2) / (self.step_s / UPSAMPLING) ** 2) ** 2)))

    def once(self, key: Any, make: Callable[[], Any]) -> Any:
        """What is the same for this run whatever the model is, made the first time that it is asked for."""
        if key not in self._series:
            self._series[key] = make()
        return self._series[key]

    def torque_pieces(self, drive: tuple[tuple[str, tuple[float, ...]], ...]) -> tuple[Array, int] | None:
        """Torque behind the given drive effects as polynomials, and how many of them a sample holds."""
        if self.torque is None:
            return None
        key = ("torque", drive)
        return self.once(key, lambda: self._make_torque(drive))

    def _make_torque(self, drive: tuple[tuple[str, tuple[float, ...]], ...]) -> tuple[Array, int]:
        assert self.torque is not None
        n = len(self.measured)
        start = self.start_s
        held = self.torque.hold == "zero_order"
        if not drive and not held:
            return smooth_pieces(self.torque.at(start + self.step_s * np.arange(n)), self.step_s), 1
        # A value held for less than a fine step keeps its own step: means over several lose what rings.
        upsampling = UPSAMPLING
        if held:
            upsampling = int(np.clip(round(self.step_s / self.torque.shortest_s), UPSAMPLING, MAX_SUBSTEPS))
        fine = self.step_s / upsampling
        count = (n - 1) * upsampling
        lead = max(0, int(min(LEAD_S, self.offset_s) / fine))  # a drive with memory has seen what came before a piece
        x = self.torque.on_half_steps(start - lead * fine, fine, count + 1 + lead).copy()  # the filters work in place
        for name, values in drive:
            effect = effects.get(name)
            size = effect.filter_states(fine, values) if effect.filter_states else 0
            run_filter(
                addresses([effect.kernel]), x, fine, np.zeros(size), np.array([0, size]),
                np.array(values), np.array([0, len(values)]),
            )  # fmt: skip
        return (held_pieces(x[lead : lead + count]) if held else linear_pieces(x[lead:], fine)), upsampling

    def effect_pieces(self, effect: Effect, shape: tuple[float, ...], unit: int) -> Array | None:
        """Torque of an effect with one linear parameter (or J, C, K: unit -3, -2, -1) at one, the rest at zero.

        ``shape`` are the values of its shape parameters in declared order. None where that torque is zero.
        """
        key = (effect.name, shape, unit)
        if key not in self._series:
            if len(self._series) > min(400, KEPT_SAMPLES // len(self.measured)):
                self._series.clear()
            self._series[key] = self._make_effect(effect, shape, unit)
        return self._series[key]

    def _make_effect(self, effect: Effect, shape: tuple[float, ...], unit: int) -> Array | None:
        angle, rate, time, torque, left = self.fine
        p = np.zeros(3 + len(effect.parameters))
        shapes = iter(shape)
        for i, parameter in enumerate(effect.parameters):
            p[3 + i] = (1.0 if i == unit else 0.0) if parameter.linear else next(shapes)
        if unit < 0:
            p[3 + unit] = 1.0
        if effect.reads is not None:
            p = np.append(p, slots(effect.reads, self)[1])
        z = np.array(effect.rest_state(angle[0], rate[0]) if effect.rest_state else [0.0] * effect.states, dtype=float)
        fine, substeps = self.step_s / UPSAMPLING, 1
        if effect.states and effect.fastest_rad_s:
            full = (1.0, 0.0, 0.0, *(v if v else 1e-12 for v in p[3 : 3 + len(effect.parameters)]))
            substeps = int(np.clip(np.ceil(fine * effect.fastest_rad_s(full) / COARSE_STEP_PHASE_RAD), 1, 8))
        out = np.empty_like(angle)
        torque_along(
            effect.kernel.address, angle, rate, time, torque, fine, z, substeps, p,
            effect.place is Place.FRICTION, max(2.0 * left, 1e-12), out,
        )  # fmt: skip
        if not np.any(out):
            return None
        ran_away = ~(np.abs(out) < RUNAWAY_TORQUE)
        return linear_pieces(np.where(ran_away, 0.0, out), fine)


def release(traces: Sequence[Trace]) -> None:
    """Give the torques back that a search has kept of these runs; they are made again where one is asked for."""
    for trace in traces:
        trace._series.clear()


def pooled_noise(traces: Sequence[Trace]) -> float:
    """The sensor's noise, one standard deviation, pooled over the runs."""
    return float(np.sqrt(np.mean([t.noise**2 for t in traces])))


def loads_differ(traces: Sequence[Trace]) -> bool:
    """Whether a known inertia was mounted for some of the runs."""
    return len({t.run.added_inertia_kg_m2 for t in traces}) > 1


def drop_samples_at_seam(trace: Trace, seam: int, keep: Any) -> None:
    """Take the samples in which the gyro's own average mixes both sides of a seam out of ``keep``, in place."""
    if trace.low_pass is not None:
        reach = int(np.ceil(trace.low_pass[1] / trace.step_s + 0.5))  # a model averages over two fine steps besides
        keep[max(0, seam - reach) : seam + reach] = False


def _gaps(flags: Any) -> list[tuple[int, int]]:
    """First and last index of every stretch of False."""
    edges = np.diff(np.concatenate([[1], np.asarray(flags, dtype=np.int8), [1]]))
    return list(zip(np.nonzero(edges == -1)[0].tolist(), (np.nonzero(edges == 1)[0] - 1).tolist(), strict=True))
