"""A process that stood still is told as such, and not as what its devices say of its silence."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from rig.clock import VirtualClock
from rig.config.limits import LimitsConfig
from rig.errors import DeviceFault, SafetyTrip
from rig.excitation import Sine, planned
from rig.guard import Guard
from rig.sequencer import SETTLE_S, Campaign, Sequencer
from tests.rig.scripted import ScriptedRig

COMPLAINT = "EMCY 0x8130 heartbeat or life guard error"
LIMITS = LimitsConfig()


def played(strike: Callable[[VirtualClock], None]) -> tuple[Campaign, ScriptedRig]:
    """A campaign in whose set ``strike`` happens within an exchange, after which the drive complains."""
    clock = VirtualClock()

    def on_exchange(now_s: float) -> None:
        if now_s >= SETTLE_S + 0.1:
            strike(clock)
            raise DeviceFault(COMPLAINT)

    rig = ScriptedRig(on_exchange)
    sequencer = Sequencer(rig, clock, Guard(LIMITS), sample_rate_hz=1000, rest_s=0.2)
    return sequencer.play(planned((Sine(torque_nm=10, frequency_hz=5, duration_s=0.5),))), rig


def for_ms(milliseconds: float) -> Callable[[VirtualClock], None]:
    def strike(clock: VirtualClock) -> None:
        clock.wait_until(clock.now_s() + milliseconds * 1e-3)

    return strike


@pytest.mark.parametrize("milliseconds", [LIMITS.stall_ms + 2, 1000.0])
def test_a_stall_within_a_tick_is_a_trip_that_also_tells_what_the_drive_said(milliseconds: float) -> None:
    campaign, rig = played(for_ms(milliseconds))
    assert isinstance(campaign.cause, SafetyTrip)
    said = str(campaign.cause)
    assert said.startswith("Torque is off. Tripped on stall or clock jump (limits.stall_ms)")
    assert f"{milliseconds:.4g} ms late" in said and said.endswith(f"Consequence: {COMPLAINT}")
    assert "torque off" in rig.log and rig.log[-2:] == ["disarm", "close"]
    assert rig.torque_nm == 0.0


def test_a_fault_without_a_stall_stays_a_fault() -> None:
    campaign, _ = played(for_ms(LIMITS.stall_ms - 2))
    assert isinstance(campaign.cause, DeviceFault)
    assert str(campaign.cause) == COMPLAINT
