"""What about the declared model makes a forecast run away."""

from __future__ import annotations

from rig.platform import Platform


def unstable_keys(platform: Platform) -> tuple[str, ...]:
    """The keys that make the declared model run away by itself: a negative stiffness, a negative damping."""
    given = (
        ("model.stiffness_nm_rad", platform.stiffness_nm_rad),
        ("model.damping_nm_s_rad", platform.damping_nm_s_rad),
    )
    return tuple(key for key, value in given if value < 0)


def model_hint(platform: Platform) -> str:
    """What about the declared model makes it hard to stay within any travel; empty where nothing does."""
    if wrong := unstable_keys(platform):
        values = {
            "model.stiffness_nm_rad": platform.stiffness_nm_rad,
            "model.damping_nm_s_rad": platform.damping_nm_s_rad,
        }
        listed = " and ".join(f"{key} is {values[key]:g}" for key in wrong)
        return (
            f"The declared model is unstable ({listed}): any torque makes it diverge. Change the sign; both "
            "must be 0 or more."
        )
    if platform.stiffness_nm_rad == 0:
        return (
            "The declared model has no stiffness, so a sine torque leaves the platform drifting. "
            "Lower the torque, shorten duration_s, or declare model.stiffness_nm_rad if the platform has a spring."
        )
    return ""
