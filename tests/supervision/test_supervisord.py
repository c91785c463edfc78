from __future__ import annotations

import os
from pathlib import Path

import pytest

from deploy.supervision import supervisord
from deploy.supervision.errors import DeploymentError


@pytest.mark.parametrize(
    ("command", "reason"),
    [("exec sleep 60", "It has not answered"), ("false", "It gave no reason"), ("echo bad", "bad")],
)
def test_supervisord_that_does_not_start_is_reported_with_the_reason(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: str, reason: str
) -> None:
    (tmp_path / "logs").mkdir()
    monkeypatch.setattr(supervisord, "COMMAND", ("sh", "-c", command))
    monkeypatch.setattr(supervisord, "READY_LIMIT", 0.1 if "sleep" in command else 60.0)
    with pytest.raises(DeploymentError) as raised:
        supervisord.start(tmp_path, os.environ)
    assert str(raised.value).startswith(f"supervisord does not start:\n{reason}")
