"""The `winding` command: signals are watched before anything heavy is imported."""

import errno
import os
import sys

from winding_cli.terminal.termination import INTERRUPTED, end, ignore_signals, watch_signals

FAILED = 1
CLOSED_PIPE = 141  # As a shell reports a program that a closed pipe has ended


def main() -> None:
    """Entry point of the console script."""
    watch_signals()
    # Sums are those of a node's process, so that a bag replays to the last bit.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    from winding_cli.app import app

    code: object = 0
    try:
        app()
    except SystemExit as ended:
        # Rich and click turn a closed pipe into an exit code of their own.
        code = CLOSED_PIPE if isinstance(ended.__context__, BrokenPipeError) else ended.code
    except OSError as error:
        if error.filename is not None or error.errno != errno.ENOSPC:
            raise
        _leave_unwritten(error)
    if code == INTERRUPTED:
        end()
    ignore_signals()
    if code == CLOSED_PIPE:
        os._exit(CLOSED_PIPE)
    try:
        sys.stdout.flush()
    except BrokenPipeError:
        os._exit(CLOSED_PIPE)
    except OSError as error:
        _leave_unwritten(error)
    sys.exit(code)  # type: ignore[arg-type]


def _leave_unwritten(error: OSError) -> None:
    """End although standard output takes nothing; the interpreter would try it once more."""
    print(f"winding: cannot write to standard output: {error.strerror}", file=sys.stderr)
    os._exit(FAILED)


if __name__ == "__main__":
    main()
