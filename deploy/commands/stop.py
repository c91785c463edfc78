"""`make stop`: needs no .venv, only the standard library of Python."""

from __future__ import annotations

import sys
from contextlib import suppress

from deploy.operator.output import say, use_plain_output
from deploy.supervision import interruption
from deploy.supervision.errors import DeploymentError
from deploy.supervision.system import System


def stop(system: System) -> None:
    """Stop a system and report it, even where no terminal is left to read it."""

    def report(count: int) -> None:
        with suppress(OSError):
            say(f"Stopping {count} processes ..." if count else "Nothing runs.")

    if system.stop(report):
        with suppress(OSError):
            say("All have ended.")


def main() -> int:
    """Stop the system of this checkout; the exit code."""
    interruption.install()
    use_plain_output()
    try:
        stop(System())
    except interruption.Interrupted:
        return 0
    except (DeploymentError, OSError) as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
