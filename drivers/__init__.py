"""Real devices: gyroscopes on a serial line, torque amplifiers on CAN, and the bench Rig made of them."""

import sys

# python-can imports asammdf, where that is installed, and that pandas: a second before every command, for MF4 logs,
# which are written once in a while (``drivers.capture.can_export``). With None in its place an import of it fails, as
# if it were not installed. Nothing imports python-can before this package.
_blocks = "can" not in sys.modules and "asammdf" not in sys.modules
if _blocks:
    sys.modules["asammdf"] = None  # type: ignore[assignment]
try:
    import can as can
finally:
    if _blocks:
        del sys.modules["asammdf"]
