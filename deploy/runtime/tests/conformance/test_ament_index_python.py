from __future__ import annotations

import os
from pathlib import Path

import pytest

from ament_index_python import (
    InvalidResourceNameError,
    InvalidResourceTypeNameError,
    get_package_share_path,
    get_resource,
    get_resource_types,
    get_resources,
    get_search_paths,
    has_resource,
)
from ament_index_python.packages import (
    PackageNotFoundError,
    get_package_prefix,
    get_package_share_directory,
    get_packages_with_prefixes,
)


def _resource(prefix: Path, kind: str, name: str, content: str = "") -> None:
    file = prefix / "share" / "ament_index" / "resource_index" / kind / name
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(content)


@pytest.fixture
def prefixes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[str, str]:
    overlay, underlay = tmp_path / "overlay", tmp_path / "underlay"
    for prefix, package in ((overlay, "arm"), (overlay, "both"), (underlay, "both"), (underlay, "base")):
        _resource(prefix, "packages", package)
    (underlay / "share" / "base").mkdir()
    _resource(overlay, "plugins", "arm", "one\ntwo\n")
    _resource(overlay, "plugins", ".hidden")
    paths = [str(overlay), str(tmp_path / "missing"), "", str(underlay)]
    monkeypatch.setenv("AMENT_PREFIX_PATH", os.pathsep.join(paths))
    return str(overlay), str(underlay)


def test_search_paths_are_those_that_exist(prefixes: tuple[str, str]) -> None:
    assert get_search_paths() == list(prefixes)


@pytest.mark.parametrize("value", [None, ""])
def test_without_prefix_path_every_query_fails(monkeypatch: pytest.MonkeyPatch, value: str | None) -> None:
    monkeypatch.delenv("AMENT_PREFIX_PATH", raising=False)
    if value is not None:
        monkeypatch.setenv("AMENT_PREFIX_PATH", value)
    with pytest.raises(EnvironmentError, match="'AMENT_PREFIX_PATH' is not set or empty"):
        get_packages_with_prefixes()


def test_packages_are_found_in_the_first_prefix_that_has_them(prefixes: tuple[str, str]) -> None:
    overlay, underlay = prefixes
    assert get_packages_with_prefixes() == {"arm": overlay, "both": overlay, "base": underlay}
    assert get_package_prefix("both") == overlay
    assert get_package_prefix("base") == underlay
    assert get_package_share_directory("base") == f"{underlay}/share/base"
    assert get_package_share_path("base") == Path(underlay, "share", "base")


def test_unknown_package_is_a_key_error_that_names_the_search_paths(prefixes: tuple[str, str]) -> None:
    with pytest.raises(PackageNotFoundError, match="package 'nothing' not found, searching: ") as raised:
        get_package_share_directory("nothing")
    assert isinstance(raised.value, KeyError)
    assert prefixes[0] in str(raised.value)


def test_name_that_no_package_can_have_is_a_value_error(prefixes: tuple[str, str]) -> None:
    with pytest.raises(ValueError, match="'_arm' is not a valid package name"):
        get_package_prefix("_arm")


def test_missing_share_directory_is_a_warning(prefixes: tuple[str, str]) -> None:
    with pytest.warns(UserWarning, match=r"Share directory for arm .* does not exist"):
        get_package_share_directory("arm")
    assert get_package_share_directory("arm", print_warning=False) == f"{prefixes[0]}/share/arm"


def test_resources_have_types_names_and_content(prefixes: tuple[str, str]) -> None:
    overlay, _ = prefixes
    assert get_resource_types() == {"packages", "plugins"}
    assert get_resources("plugins") == {"arm": overlay}
    assert get_resource("plugins", "arm") == ("one\ntwo\n", overlay)
    assert has_resource("plugins", "arm") == overlay
    assert has_resource("plugins", "base") is False


def test_missing_and_invalid_resources_are_errors(prefixes: tuple[str, str]) -> None:
    with pytest.raises(LookupError, match="Could not find the resource 'base' of type 'plugins'"):
        get_resource("plugins", "base")
    with pytest.raises(InvalidResourceTypeNameError, match="Resource type 'a/b' is invalid"):
        get_resources("a/b")
    with pytest.raises(InvalidResourceNameError, match="Resource name 'a/b' is invalid"):
        has_resource("plugins", "a/b")
