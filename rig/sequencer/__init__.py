"""The sequencer: probes, then plays the planned sets on a rig against absolute deadlines, and records them."""

from rig.sequencer.observer import Observer, Progress
from rig.sequencer.probe import Probe
from rig.sequencer.recorder import SetRecorder, SetStatistics
from rig.sequencer.sequencer import SETTLE_S, TAIL_S, Campaign, Sequencer

__all__ = [
    "SETTLE_S",
    "TAIL_S",
    "Campaign",
    "Observer",
    "Probe",
    "Progress",
    "Sequencer",
    "SetRecorder",
    "SetStatistics",
]
