"""What Cyclone DDS writes to standard error while a process joins with keys.

It reports each participant that it hears before it has read its own keys, and why it cannot join. It has no
function that directs the log of a domain elsewhere.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager

_STANDARD_ERROR = 2
_HEARD = re.compile(rb"^\S+ \[\d+\] +dq\.builtin: .*\n", re.MULTILINE)
_REASON = re.compile(rb"^\S+ \[\d+\] +\S+: (.*)\n(?:\(code: \d+\)\n)?", re.MULTILINE)


@contextmanager
def kept() -> Iterator[Callable[[], str]]:
    """Keep standard error within the ``with``; at its end, what others have written is written.

    It yields a function that returns why the process cannot join.
    """
    file, original = os.memfd_create("log"), os.dup(_STANDARD_ERROR)

    def text() -> bytes:
        return os.pread(file, os.fstat(file).st_size, 0)

    def reasons() -> str:
        return "".join(f": {it.decode(errors='replace')}" for it in _REASON.findall(_HEARD.sub(b"", text())))

    os.dup2(file, _STANDARD_ERROR)
    known = _HEARD
    try:
        yield reasons
    except BaseException:
        known = _REASON  # in the exception
        raise
    finally:
        os.dup2(original, _STANDARD_ERROR)
        os.close(original)
        os.write(_STANDARD_ERROR, known.sub(b"", text()))
        os.close(file)
