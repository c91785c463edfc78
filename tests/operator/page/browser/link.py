"""A TCP link between page and server that a test holds up."""

from __future__ import annotations

import contextlib
import socket
import threading
import time


class Link:
    """Passes on bytes between the clients of an address and a server, or lets them wait."""

    def __init__(self, address: str, server: tuple[str, int], path: bytes = b"/") -> None:
        """:param path: below which the page lies for clients, as behind a reverse proxy."""
        self._server = server
        self._path = path
        self._from_page, self._from_server = threading.Event(), threading.Event()
        self._sockets: list[socket.socket] = []
        self._threads: list[threading.Thread] = []
        self.mend()
        self._listener = socket.create_server((address, server[1]))
        self._start(self._accept)

    def hold_up_page(self) -> None:
        self._from_page.clear()

    def cut(self) -> float:
        """Let the bytes of both wait; when that holds [s since 1970]."""
        self._from_page.clear()
        self._from_server.clear()
        time.sleep(0.02)  # the threads pass on what they have in hand
        return time.time()

    def mend(self) -> None:
        self._from_page.set()
        self._from_server.set()

    def close(self) -> None:
        for each in (self._listener, *self._sockets):
            with contextlib.suppress(OSError):
                each.shutdown(socket.SHUT_RDWR)
        self.mend()
        for thread in self._threads:
            thread.join()
        for each in (self._listener, *self._sockets):
            each.close()

    def _start(self, run: object, *arguments: object) -> None:
        self._threads.append(threading.Thread(target=run, args=arguments))  # type: ignore[arg-type]
        self._threads[-1].start()

    def _accept(self) -> None:
        with contextlib.suppress(OSError):  # the listener is closed
            while True:
                page, _ = self._listener.accept()
                page.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, True)
                self._sockets.append(page)
                try:
                    server = socket.create_connection(self._server)
                except OSError:
                    page.shutdown(socket.SHUT_RDWR)
                    continue
                server.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, True)
                self._sockets.append(server)
                self._start(self._pass_on, page, server, self._from_page, b"GET " + self._path)
                self._start(self._pass_on, server, page, self._from_server)

    @staticmethod
    def _pass_on(
        source: socket.socket, target: socket.socket, gate: threading.Event, request: bytes = b""
    ) -> None:
        with contextlib.suppress(OSError):
            while data := source.recv(65536):
                gate.wait()
                if request and data.startswith(request):
                    data = b"GET /" + data[len(request) :]
                target.sendall(data)
        gate.wait()
        with contextlib.suppress(OSError):
            target.shutdown(socket.SHUT_WR)
