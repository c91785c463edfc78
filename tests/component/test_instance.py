from __future__ import annotations

import os
import socket
import subprocess
import sys
from contextlib import ExitStack
from types import SimpleNamespace
from typing import Any

import pytest

from interfaces.service import unix_sockets
from interfaces.service.instance import AlreadyRunning, claim, holders
from tests.users import NOBODY, fork, needs_root

NAME = f"/arm{os.getpid()}/velocity"  # of no other process on this host
LONG = NAME + "a" * 200


def node(name: str, domain: int = 7) -> Any:
    context = SimpleNamespace(get_domain_id=lambda: domain)
    return SimpleNamespace(context=context, get_fully_qualified_name=lambda: name)


@pytest.mark.parametrize("name", [NAME, LONG], ids=["short", "long"])
def test_name_holders_until_the_claim_ends(name: str) -> None:
    assert not holders(name, 7)
    with claim(node(name)):
        assert holders(name, 7)
        with pytest.raises(AlreadyRunning, match=f"^{name} already runs in domain 7$"):
            claim(node(name))
    assert not holders(name, 7)


def test_other_name_or_domain_is_another_claim() -> None:
    with claim(node(LONG)), claim(node(LONG + "b")), claim(node(LONG, 8)):
        assert holders(LONG, 7)
        assert holders(LONG, 8)
        assert not holders(LONG + "c", 7)


def test_sockets_of_other_programs_may_have_any_name() -> None:
    with socket.socket(socket.AF_UNIX) as other, claim(node(NAME)):
        other.bind(f"\0{NAME}".encode() + b"\xff")
        assert holders(NAME, 7)


def test_refused_claim_leaves_nothing_open() -> None:
    with claim(node(NAME)):
        before = len(os.listdir("/proc/self/fd"))
        with pytest.raises(AlreadyRunning) as refused:  # its traceback keeps the objects of the claim
            claim(node(NAME))
        assert len(os.listdir("/proc/self/fd")) == before
    assert refused.tb


def address(number: int, name: str = NAME) -> str:
    with claim(node(name)) as held:
        return f"{held.getsockname().decode().rpartition('/')[0]}/{number}"


def bound(*addresses: str) -> list[socket.socket]:
    sockets = [socket.socket(socket.AF_UNIX) for _ in addresses]
    for each, name in zip(sockets, addresses, strict=True):
        each.bind(name)
    return sockets


@needs_root
def test_another_user_takes_no_name() -> None:
    free = [address(number) for number in range(3)]
    with fork(lambda: bound(*free), user=NOBODY):
        assert holders(NAME, 7) == {NOBODY}
        with claim(node(NAME)):
            assert holders(NAME, 7) == {NOBODY, 0}
            with pytest.raises(AlreadyRunning):
                claim(node(NAME))
    assert not holders(NAME, 7)


@needs_root
def test_address_that_another_user_frees_gives_no_second_claim() -> None:
    with ExitStack() as stack:
        with fork(lambda: bound(address(0)), user=NOBODY):
            stack.enter_context(claim(node(NAME)))
        before = len(os.listdir("/proc/self/fd"))
        with pytest.raises(AlreadyRunning):
            claim(node(NAME))
        assert len(os.listdir("/proc/self/fd")) == before


@needs_root
def test_claim_of_another_user_counts_if_it_shall() -> None:
    free = address(0)
    with fork(lambda: bound(free), user=NOBODY), pytest.raises(AlreadyRunning):
        claim(node(NAME), others_count=True)
    with claim(node(NAME), others_count=True):
        pass


@needs_root
def test_claim_beside_another_user_ends_with_its_process() -> None:
    free = address(0)
    with fork(lambda: bound(free), user=NOBODY):
        with fork(lambda: claim(node(NAME))):
            assert holders(NAME, 7) == {NOBODY, 0}
        assert holders(NAME, 7) == {NOBODY}


@needs_root
def test_network_namespace_has_claims_of_its_own() -> None:
    code = f"NAME = {NAME!r}; held = claim(node(NAME)); print(holders(NAME, 7))"
    command = [
        "unshare",
        "--net",
        sys.executable,
        "-c",
        f"from tests.component.test_instance import *; {code}",
    ]
    with claim(node(NAME)):
        done = subprocess.run(command, capture_output=True, text=True)
    assert (done.stdout, done.stderr) == ("{0}\n", "")


def test_without_the_users_of_sockets_all_claims_are_ours(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(unix_sockets, "_from_the_kernel", list)
    with socket.socket(socket.AF_UNIX) as other, claim(node(NAME)):
        other.bind(f"\0{NAME}".encode() + b"\xff")
        assert holders(NAME, 7) == {os.geteuid()}
        with pytest.raises(AlreadyRunning):
            claim(node(NAME))
    assert not holders(NAME, 7)
