from __future__ import annotations

import os
import socket
from types import SimpleNamespace
from typing import Any

import pytest

from interfaces.service.instance import AlreadyRunning, claim, is_claimed

NAME = f"/arm{os.getpid()}/velocity"  # of no other process on this host
LONG = NAME + "a" * 200


def node(name: str, domain: int = 7) -> Any:
    context = SimpleNamespace(get_domain_id=lambda: domain)
    return SimpleNamespace(context=context, get_fully_qualified_name=lambda: name)


@pytest.mark.parametrize("name", [NAME, LONG], ids=["short", "long"])
def test_name_is_claimed_until_the_claim_ends(name: str) -> None:
    assert not is_claimed(name, 7)
    with claim(node(name)):
        assert is_claimed(name, 7)
        with pytest.raises(AlreadyRunning, match=f"^{name} already runs in domain 7$"):
            claim(node(name))
    assert not is_claimed(name, 7)


def test_other_name_or_domain_is_another_claim() -> None:
    with claim(node(LONG)), claim(node(LONG + "b")), claim(node(LONG, 8)):
        assert is_claimed(LONG, 7)
        assert is_claimed(LONG, 8)
        assert not is_claimed(LONG + "c", 7)


def test_sockets_of_other_programs_may_have_any_name() -> None:
    with socket.socket(socket.AF_UNIX) as other, claim(node(NAME)):
        other.bind(f"\0{NAME}".encode() + b"\xff")
        assert is_claimed(NAME, 7)


def test_refused_claim_leaves_nothing_open() -> None:
    with claim(node(NAME)):
        before = len(os.listdir("/proc/self/fd"))
        with pytest.raises(AlreadyRunning) as refused:  # its traceback keeps the objects of the claim
            claim(node(NAME))
        assert len(os.listdir("/proc/self/fd")) == before
    assert refused.tb
