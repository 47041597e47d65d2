"""A process of its own for one campaign: the job comes as JSON on stdin, the row goes as JSON to stdout."""

from __future__ import annotations

import json
import sys


def main() -> None:
    """Identify the campaign on stdin."""
    from commands.identify_batch.campaign import identified_here
    from commands.identify_batch.campaigns import Job
    from commands.terminal.exit_codes import hide_library_warnings

    hide_library_warnings()
    given = json.load(sys.stdin)
    job = Job(**given | {"overrides": tuple(given["overrides"])})
    sys.stdout.write(json.dumps(identified_here(job)) + "\n")


if __name__ == "__main__":
    main()
