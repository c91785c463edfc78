"""The link between two hosts is cut while a hand holds: network namespaces, TLS, a page of another host."""

from __future__ import annotations

import os
import shutil
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from tests.chaos.partition import BRIDGE, CONTROL, NETWORK, ROBOT, missing, namespaces

from . import chromium
from .arm import GONE, Arm, hold_with_engines_on
from .chromium import CHROMIUM, HandOnPage

pytestmark = pytest.mark.timed

ADDRESS = f"{NETWORK}.1"  # of the robot's host
S1 = 10.5  # s


@pytest.fixture
def full(playwright: Any) -> Iterator[Callable[[str], str]]:
    """The namespaces of two hosts: their full names."""
    if reason := missing():
        pytest.skip(f"platform: {reason}")
    if shutil.which("openssl") is None:
        pytest.skip("platform: there is no openssl for a certificate")
    with namespaces() as full:
        yield full


@pytest.fixture
def arm(full: Callable[[str], str], tmp_path: Path, domain_id: int) -> Iterator[Arm]:
    """The arm on the robot's host, which listens to the network with TLS."""
    certificate, key = tmp_path / "certificate.pem", tmp_path / "key.pem"
    kind = ["-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes", "-days", "1"]
    files = ["-out", str(certificate), "-keyout", str(key)]
    subprocess.run(["openssl", "req", *kind, "-subj", "/CN=arm", *files], check=True, capture_output=True)
    page = {"address": ADDRESS, "certificate": certificate, "key": key}
    with closing(Arm(tmp_path / "run", domain_id, full(ROBOT), **page)) as arm:
        yield arm


@pytest.fixture
def hand(playwright: Any, full: Callable[[str], str], arm: Arm, tmp_path: Path) -> Iterator[HandOnPage]:
    script = tmp_path / "chromium"
    script.write_text(f'#!/bin/sh\nexec ip netns exec {full(CONTROL)} {CHROMIUM} "$@"\n')
    os.chmod(script, 0o700)
    with closing(chromium.launch(playwright, executable=str(script))) as browser:
        yield HandOnPage(browser.new_context(ignore_https_errors=True), arm.url)


def test_engines_stop_in_time_after_the_link_is_cut(
    arm: Arm, hand: HandOnPage, full: Callable[[str], str]
) -> None:
    def set_link(state: str) -> None:
        command = ["ip", "-n", full(BRIDGE), "link", "set", CONTROL, state]
        subprocess.run(command, check=True, capture_output=True)

    assert arm.url.startswith(f"https://{ADDRESS}:")
    assert hand.page.get_attribute("#services", "data-local") == "no"
    assert hand.page.locator("button[data-action=kill]").first.is_hidden()
    hold_with_engines_on(arm, hand)
    arm.record.await_beats(time.time())
    set_link("down")
    cut = time.time()
    arm.record.silence_after(cut + GONE, 1.0)
    assert hand.state == "offline"
    last = arm.record.beats[-1]
    off = arm.record.await_off(cut)
    print(f"link cut: last heartbeat after {last - cut:.3f} s, engines off after {off - cut:.3f} s")
    assert off - last <= S1

    set_link("up")
    hand.await_live()
    hand.await_state("released")
    arm.record.silence_after(cut + GONE, time.time() - cut + 0.5)
    hand.up()
    hand.hold()
    arm.record.await_beats(time.time())
