"""What the nodes of an arm need from the middleware."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

from deploy.running.environment import set_middleware


def test_the_settings_of_the_user_win() -> None:
    settings: dict[str, str] = {}
    set_middleware(settings)
    assert settings["ROS_AUTOMATIC_DISCOVERY_RANGE"] == "LOCALHOST"
    users = dict.fromkeys(settings, "as the user likes")
    unchanged = dict(users)
    set_middleware(users)
    assert users == unchanged


def test_participants_of_fast_dds_announce_themselves_in_time() -> None:
    """A killed service is heard again within a second. Fast DDS ignores a profile that it cannot read."""
    settings: dict[str, str] = {}
    set_middleware(settings)
    profiles = ElementTree.parse(Path(settings["FASTRTPS_DEFAULT_PROFILES_FILE"])).getroot()
    names = {"": "http://www.eprosima.com/XMLSchemas/fastRTPS_Profiles"}
    (participant,) = profiles.findall("profiles/participant", names)
    assert participant.get("is_default_profile") == "true"
    seconds = participant.findtext(".//leaseAnnouncement/sec", namespaces=names)
    nanoseconds = participant.findtext(".//leaseAnnouncement/nanosec", namespaces=names)
    assert 0.0 < float(seconds or 0) + float(nanoseconds or 0) * 1e-9 <= 0.5
