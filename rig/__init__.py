"""What the platform is and how to play on it: configuration, model, effects, excitation, recording."""

from rig.compiled_cache import ensure_compiled_cache

ensure_compiled_cache()  # here, because it has to come before the first kernel of any package is compiled
