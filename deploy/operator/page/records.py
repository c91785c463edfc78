"""The records of `make record` over HTTP: a page links the one that has its last stop."""

from __future__ import annotations

import http
import json
import os
import re
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO, NamedTuple

from websockets.http11 import Response

from deploy.operator.page.site import RECORDS as PATH
from deploy.operator.page.site import respond
from deploy.supervision.run_directory import STOP_RECORD

MOST = 100  # that are listed
PIECE = 65_536  # bytes that are sent at a time
_NAME = re.compile(rf"({STOP_RECORD})?(\d{{8}}-\d{{6}})(\.\d{{3}})?\.mcap")


class Record(NamedTuple):
    path: Path
    is_of_stop: bool
    begin: float
    """Of its file or, of the record of a stop, the stop [s since 1970]."""
    end: float


class Download(Response):
    """The head of a response whose body is in a file, which the connection closes."""

    file: BinaryIO
    left: int
    """Bytes of the file that are sent: those that it has now."""

    def next(self) -> bytes:
        """Return the next piece. It is empty at the end of the file, which may have become shorter."""
        piece = self.file.read(min(PIECE, self.left))
        self.left -= len(piece)
        return piece


class Records:
    def __init__(self, folder: Path | None, elapsed: Callable[[], float]) -> None:
        """:param folder: of the records; ``None`` if there is none.
        :param elapsed: returns the time of the scenario [s].
        """
        self._folder = folder
        self._elapsed = elapsed

    def answer(self, path: str) -> Response | None:
        """Answer a request for the list of the newest records, or for one of it; ``None`` for another."""
        if path == PATH:
            return respond(http.HTTPStatus.OK, "application/json", json.dumps(self._list()).encode())
        for record in self._newest():
            if path == f"{PATH}/{record.path.name}":
                return _download(record.path)
        return None

    def _list(self) -> list[dict[str, object]]:
        """Return name, begin and end of each record by the time of the scenario; those of stops first."""
        origin = time.time() - self._elapsed()
        records = sorted(self._newest(), key=lambda it: (not it.is_of_stop, -it.begin))
        return [{"name": it.path.name, "begin": it.begin - origin, "end": it.end - origin} for it in records]

    def _newest(self) -> list[Record]:
        return sorted(self._found(), key=lambda it: -it.end)[:MOST]

    def _found(self) -> Iterator[Record]:
        try:
            entries = [*os.scandir(self._folder)] if self._folder else []
        except OSError:  # nothing was recorded yet
            return
        for entry in entries:
            found = _NAME.fullmatch(entry.name)
            # An error: the ring has removed it meanwhile, or its name is no time.
            with suppress(OSError, ValueError, OverflowError):
                if found and entry.is_file(follow_symlinks=False):
                    begin = time.mktime(time.strptime(found[2], "%Y%m%d-%H%M%S"))
                    yield Record(Path(entry.path), bool(found[1]), begin, entry.stat().st_mtime)


def _download(path: Path) -> Response:
    try:
        file = open(path, "rb", buffering=0, opener=_without_links)  # noqa: SIM115
    except OSError:  # the ring has removed it
        return respond(http.HTTPStatus.NOT_FOUND)
    size = os.fstat(file.fileno()).st_size
    head = respond(http.HTTPStatus.OK, "application/octet-stream")
    del head.headers["Content-Length"]
    head.headers["Content-Length"] = str(size)
    download = Download(head.status_code, head.reason_phrase, head.headers)
    download.file, download.left = file, size
    return download


def _without_links(path: str, flags: int) -> int:
    return os.open(path, flags | os.O_NOFOLLOW | os.O_NONBLOCK)
