"""A frequency response from one record played once: the local polynomial method.

Pintelon & Schoukens, System Identification, 2nd ed., chapter 7. Over a few neighbouring bins the response is as
smooth as the transient that the ends of the record leave, but only the response goes with the torque.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import fft, signal

from identify.frequency.spectra import Complex, Record, Response, chosen, excited, stands_apart
from rig.recording.run import Array

NEIGHBOUR_BINS = 5  # bins either way behind a local polynomial
POLYNOMIAL_ORDER = 2  # degree of that polynomial
DISTINCT = 0.3  # share of a line's torque that no parabola over the bins takes for a transient


def by_local_polynomial(records: Sequence[Record]) -> Response:
    """Response and transient as parabolas over neighbouring bins of the whole record.

    Around bin k: Y(k + r) = G(r) U(k + r) + T(r) + noise, with G common to all records and a transient T for each.
    Coherence is the share of the power that G explains, both sides over their degrees of freedom. Lines whose
    torque looks like a transient itself (the very ends of a sweep) are left out.
    """
    n = _length(records[0].torque_nm)
    spectra = [tuple(fft.rfft(v[:n] - np.mean(v[:n])) for v in (r.torque_nm, r.motion)) for r in records]
    f = fft.rfftfreq(n, records[0].step_s)
    last = len(f) - 1
    power = np.sum([np.abs(u) ** 2 for u, _ in spectra], axis=0)
    if stands_apart(records[0].torque_nm[:n]):
        peaks = signal.find_peaks(power)[0]
        power = np.where(np.isin(np.arange(len(f)), peaks), power, 0.0)
    at = chosen(f, power) if last > 2 * NEIGHBOUR_BINS else np.empty(0, dtype=np.int_)
    lines = [(f[k], *line) for k in at if (line := _local(spectra, int(k), last)) is not None]
    columns = np.array(lines, dtype=complex).reshape(-1, 5).T
    hertz, coherence, error, freedom = columns[[0, 2, 3, 4]].real
    return Response(hertz, columns[1], coherence, error, freedom, "local polynomial")


def _length(torque: Array) -> int:
    """All samples, or all but the last: a set that is played from end to end holds its first instant twice."""
    counts = [(excited(torque[:n], np.ones(n)).sum(), n) for n in (len(torque), len(torque) - 1)]
    return min(counts, key=lambda c: c[0])[1]


def _local(spectra: Sequence[tuple[Complex, ...]], k: int, last: int) -> tuple[complex, float, float, float] | None:
    """Response, coherence, relative error and degrees of freedom at one bin; None where U passes for a transient."""
    begin = int(np.clip(k - NEIGHBOUR_BINS, 1, last - 2 * NEIGHBOUR_BINS))
    bins = np.arange(begin, begin + 2 * NEIGHBOUR_BINS + 1)
    powers = np.vander((bins - k) / NEIGHBOUR_BINS, POLYNOMIAL_ORDER + 1, increasing=True)
    scale = max(float(np.max(np.abs(u[bins]))) for u, _ in spectra)
    through = np.concatenate([powers * (u[bins] / scale)[:, None] for u, _ in spectra])
    starts = np.kron(np.eye(len(spectra)), powers)
    y = np.concatenate([y[bins] for _, y in spectra])
    clean, alone = (v - starts @ np.linalg.lstsq(starts, v, rcond=1e-9)[0] for v in (through, y))
    if np.linalg.norm(clean[:, 0]) < DISTINCT * np.linalg.norm(through[:, 0]):
        return None
    found, _, rank, _ = np.linalg.lstsq(clean, alone, rcond=1e-6)
    left = alone - clean @ found
    free_alone = len(y) - starts.shape[1]
    free = free_alone - int(rank)
    noise = float(np.sum(np.abs(left) ** 2)) / max(free, 1)
    total = float(np.sum(np.abs(alone) ** 2)) / free_alone
    coherence = float(np.clip(1.0 - noise / max(total, 1e-300), 0.0, 1.0)) if free > 0 else 0.0
    spread = float(np.sum(np.abs(np.linalg.pinv(clean, rcond=1e-6)[0]) ** 2))
    error = float(np.sqrt(0.5 * noise * spread)) / max(abs(found[0]), 1e-300)
    return complex(found[0] / scale), coherence, error, float(free)
