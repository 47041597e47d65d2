"""A proof as result.json has it."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from identify.proof.wording import lines
from identify.proven import EffectProof, Proof, Share


def proof_json(proof: Proof) -> dict[str, Any]:
    """Verdict and shares of all effects together, of each name and of each rival; lines of the report apart."""
    return {
        "status": proof.total.status,
        "total": _effect(proof.total),
        "effects": {name: _effect(one) for name, one in proof.effects.items()},
        "rivals": {pair: _effect(one) for pair, one in proof.rivals.items()},
        "not_cancelled": dict(proof.not_cancelled),
        "torque_scale": dict(proof.torque_scale),
        "excluded": list(proof.excluded),
        "late_ticks": None if proof.late is None else asdict(proof.late),
        "sentences": lines(proof),
    }


def _effect(one: EffectProof) -> dict[str, Any]:
    return {
        "status": one.status,
        "why": one.why,
        **_share(one.share),
        "announced_gone": 1.0 - one.announced_left,
        "stays": one.stays,
        "per_set": [
            {
                "set": s.set, "without": s.without, "compensated": s.compensated, "error_without": s.error_without,
                "error_compensated": s.error_compensated, "noise": s.noise, **_share(s.share),
                "announced_gone": 1.0 - s.announced_left, "announced_error_without": s.announced_error,
            }
            for s in one.sets
        ],
    }  # fmt: skip


def _share(share: Share | None) -> dict[str, Any]:
    if share is None:
        return {"gone": None, "gone_ci95": None}
    return {"gone": share.gone, "gone_ci95": list(share.gone_ci95)}
