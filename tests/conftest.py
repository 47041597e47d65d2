"""What every test starts from."""

from __future__ import annotations

import signal

# A test runner that was itself started in the background, or under nohup, hands down ignored signals.
signal.signal(signal.SIGINT, signal.default_int_handler)
for _name in ("SIGHUP", "SIGTERM"):
    if hasattr(signal, _name):
        signal.signal(getattr(signal, _name), signal.SIG_DFL)
