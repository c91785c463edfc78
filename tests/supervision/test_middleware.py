from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import pytest

from deploy.supervision.environment import set_middleware


def test_the_settings_of_the_user_win() -> None:
    settings: dict[str, str] = {}
    set_middleware(settings)
    assert settings["ROS_AUTOMATIC_DISCOVERY_RANGE"] == "LOCALHOST"
    users = dict.fromkeys(settings, "as the user likes")
    unchanged = dict(users)
    set_middleware(users)
    assert users == unchanged


@pytest.mark.parametrize("file", ["fastdds.xml", "fastdds.localhost.xml"])
def test_settings_of_fast_dds_bring_a_killed_service_back_in_time(file: str) -> None:
    """Fast DDS ignores a profile that it cannot read."""
    settings: dict[str, str] = {}
    set_middleware(settings)
    profiles = ElementTree.parse(Path(settings["FASTRTPS_DEFAULT_PROFILES_FILE"]).with_name(file)).getroot()
    names = {"": "http://www.eprosima.com/XMLSchemas/fastRTPS_Profiles"}

    def duration(path: str) -> float:
        parts = (profiles.findtext(f".//{path}/{part}", namespaces=names) for part in ("sec", "nanosec"))
        seconds, nanoseconds = (float(part or 0) for part in parts)
        return seconds + nanoseconds * 1e-9

    for kind in ("participant", "data_reader"):
        (profile,) = profiles.findall(f"profiles/{kind}", names)
        assert profile.get("is_default_profile") == "true"
    assert 0.0 < duration("leaseAnnouncement") <= 0.31
    assert 0.0 < duration("initialAcknackDelay") <= 0.01


@pytest.mark.parametrize(
    ("runtime", "namespace", "tagged"),
    [("cyclonedds", "/arm1", True), ("cyclonedds", "/", False), ("", "/arm1", False)],
)
def test_arm_in_a_namespace_has_a_tag_on_cyclone_dds(runtime: str, namespace: str, tagged: bool) -> None:
    settings = {"RUNTIME": runtime, "REACTIVE_ARM_NAMESPACE": namespace}
    set_middleware(settings)
    assert (f"<Tag>{namespace}</Tag>" in settings.get("CYCLONEDDS_URI", "")) == tagged


def test_user_may_take_the_tag_away() -> None:
    settings = {"RUNTIME": "cyclonedds", "REACTIVE_ARM_NAMESPACE": "/arm1", "CYCLONEDDS_URI": ""}
    set_middleware(settings)
    assert settings["CYCLONEDDS_URI"] == ""
