"""A crowd of strangers: connections without the token, and a new one for each that the server closes.

python -m tests.operator.page.crowd PORT COUNT KIND [ADDRESS...]
"""

from __future__ import annotations

import contextlib
import selectors
import socket
import sys
import time
from itertools import cycle

PERIOD = 0.05  # s between two bytes of a slow request
REQUEST = (
    "GET /socket HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nOrigin: http://127.0.0.1:{port}\r\n"
    "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
    "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n"
)
HELLO = b'{"type": "hello", "token": "guess"}'
MASKED = b"\x81" + bytes([0x80 | len(HELLO)]) + bytes(4) + HELLO  # a text frame with the mask 0

FIRST = {
    "idle": "",
    "half": "GET /socket HTTP/1.1\r\nHost:",
    "slow": "GET /socket HTTP/1.1\r\nX: ",
    "silent": REQUEST,
    "guessing": REQUEST,
}
"""What each kind sends first: nothing, part of a request, a part that goes on, or a whole one."""


def main(port: int, count: int, kind: str, *addresses: str) -> None:
    selector = selectors.DefaultSelector()
    sources = cycle(addresses or ["127.0.0.1"])
    first = FIRST[kind].format(port=port).encode()

    def join() -> None:
        with contextlib.suppress(OSError):
            stranger = socket.create_connection(("127.0.0.1", port), 5.0, (next(sources), 0))
            stranger.sendall(first + (MASKED if kind == "guessing" else b""))
            stranger.setblocking(False)
            selector.register(stranger, selectors.EVENT_READ)

    for _ in range(count):
        join()
    print("ready", flush=True)
    while True:
        for key, _ in selector.select(PERIOD):
            stranger = key.fileobj
            assert isinstance(stranger, socket.socket)
            try:
                is_closed = not stranger.recv(65536)
            except OSError:
                is_closed = True
            if is_closed:
                selector.unregister(stranger)
                stranger.close()
        if kind == "slow":
            time.sleep(PERIOD)
            for key in selector.get_map().values():
                with contextlib.suppress(OSError):
                    key.fileobj.send(b"x")  # type: ignore[union-attr]
        for _ in range(count - len(selector.get_map())):
            join()


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]), *sys.argv[3:])
