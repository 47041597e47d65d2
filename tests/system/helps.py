"""What commands print for --help: each is run as documented, all in one process that loads the libraries once.

python -m tests.system.helps  <  a list of command lines as JSON  >  exit code, stdout and stderr of each as JSON
"""

from __future__ import annotations

import contextlib
import importlib
import io
import json
import runpy
import sys
from collections.abc import Sequence


def run(command: Sequence[str]) -> tuple[int, str, str]:
    """Exit code, stdout and stderr of `python -m MODULE ...`, or of an entry point `MODULE:FUNCTION ...`."""
    program, *rest = command
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            if program == "python":
                _, module, *sys.argv[1:] = rest
                runpy.run_module(module, run_name="__main__", alter_sys=True)
            else:
                module, _, function = program.partition(":")
                sys.argv[1:] = rest
                getattr(importlib.import_module(module), function)()
        except SystemExit as end:
            code = end.code
        except Exception as error:  # noqa: BLE001 (whatever a command raises is its answer)
            return 70, out.getvalue(), f"{err.getvalue()}{type(error).__name__}: {error}"
        else:
            code = 0
    return code if isinstance(code, int) else int(code is not None), out.getvalue(), err.getvalue()


if __name__ == "__main__":
    json.dump([run(command) for command in json.load(sys.stdin)], sys.stdout)
