"""A process of its own for one campaign: the job comes as a line of JSON on stdin, the row goes as one to stdout."""

from __future__ import annotations

import json
import os
import sys
import threading


def main() -> None:
    """Identify the campaign on stdin; end at once when stdin does, because then whoever asked is gone."""
    from commands.identify_batch.campaign import identified_here
    from commands.identify_batch.campaigns import Job
    from commands.terminal.exit_codes import hide_library_warnings

    hide_library_warnings()
    given = json.loads(sys.stdin.readline())
    threading.Thread(target=_end_with_stdin, daemon=True).start()
    job = Job(**given | {"overrides": tuple(given["overrides"])})
    sys.stdout.write(json.dumps(identified_here(job)) + "\n")
    sys.stdout.flush()
    os._exit(0)  # not held up by the thread that still reads


def _end_with_stdin() -> None:
    sys.stdin.read()
    os._exit(1)


if __name__ == "__main__":
    main()
