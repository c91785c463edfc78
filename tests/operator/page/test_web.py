"""What the page is started with: WEB moves it or switches it off, a parameter file sets the rest."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from deploy.commands import parameters
from deploy.supervision.environment import NAMESPACE
from deploy.supervision.errors import DeploymentError
from deploy.supervision.run_directory import KEY


def port_of(web: str, namespace: str = "", user_file: str = "") -> Any:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("WEB", web)
        patch.setenv(NAMESPACE, namespace)
        given = parameters.of_system("demo", user_file)
    return given.get(f"{namespace}/operator_page", {}).get(KEY)


@pytest.mark.parametrize(
    ("web", "expected"),
    [("", None), ("off", {"port": 0}), ("8000", {"port": 8000}), ("65535", {"port": 65535})],
)
def test_web_sets_the_port(web: str, expected: object) -> None:
    assert port_of(web) == expected
    assert port_of(web, "/arm1") == expected


@pytest.mark.parametrize("web", ["on", "0", "65536", "-1", "8000 ", "80.0", "localhost:80", "²"])
def test_other_values_are_an_error(web: str) -> None:
    with pytest.raises(DeploymentError, match=r"^WEB=.* is neither off nor a port from 1 to 65535$"):
        port_of(web)


def test_web_wins_over_the_parameter_file(tmp_path: Path) -> None:
    file = tmp_path / "parameters.yaml"
    file.write_text("operator_page: {ros__parameters: {port: 9000, names: arm.example}}")

    assert port_of("", user_file=str(file)) == {"port": 9000, "names": "arm.example"}
    assert port_of("8000", user_file=str(file)) == {"port": 8000, "names": "arm.example"}


def test_files_of_the_page_are_next_to_the_parameter_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    loaded: list[tuple[str, ...]] = []
    monkeypatch.setattr(parameters, "tls", lambda *given: loaded.append(given))
    file = tmp_path / "parameters.yaml"
    file.write_text("operator_page: {ros__parameters: {certificate: arm.pem, key: /etc/arm.key}}")

    started_with = port_of("", user_file=str(file))

    assert started_with == {"certificate": str(tmp_path / "arm.pem"), "key": "/etc/arm.key"}
    assert loaded == [("127.0.0.1", str(tmp_path / "arm.pem"), "/etc/arm.key")]


def test_page_knows_the_limits_of_other_services(tmp_path: Path) -> None:
    file = tmp_path / "parameters.yaml"
    file.write_text(
        "operator_watchdog: {ros__parameters: {silence: 2.0, repeat: 0.2}}\n"
        "engine_controller: {ros__parameters: {presence_timeout: 4.0, max_presence_age: 0.8}}\n"
    )
    limits = {"silence": 2.0, "presence_timeout": 4.0, "max_presence_age": 0.8}
    for namespace in ("", "/arm1"):
        assert port_of("", namespace, str(file)) == limits
