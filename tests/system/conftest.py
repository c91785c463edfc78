"""Sites for systems under test, each with a run directory and a DDS domain."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from tests.system.sites import Checkout, Peer, Site, make_small_arm


@pytest.fixture
def site(tmp_path: Path, domain_id: int) -> Iterator[Site]:
    with closing(Site(tmp_path / "run", domain_id)) as site:
        yield site


@pytest.fixture(scope="module")
def module_site(tmp_path_factory: pytest.TempPathFactory, module_domain_id: int) -> Iterator[Site]:
    """A site for a system that the tests of a module share; its path is as unpleasant as paths get."""
    run = tmp_path_factory.mktemp("unpleasant") / 'it\'s 100 % "fine"' / ("deep" * 30) / "run"
    with closing(Site(run, module_domain_id)) as site:
        yield site


@pytest.fixture(scope="session")
def small_arm(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The checkout of a small arm; tests leave it as it is."""
    return make_small_arm(tmp_path_factory.mktemp("small"))


@pytest.fixture
def small_site(small_arm: Path, tmp_path: Path, domain_id: int) -> Iterator[Site]:
    """A site for a small arm of this test: for what does not depend on the services there are."""
    with closing(Site(tmp_path / "run", domain_id, directory=small_arm)) as site:
        yield site


@pytest.fixture
def checkout(small_arm: Path, domain_id: int) -> Iterator[Checkout]:
    """A site for a small arm of this test, as in a user's checkout."""
    with closing(Checkout(small_arm, domain_id)) as site:
        yield site


@pytest.fixture
def peer(module_site: Site) -> Iterator[Peer]:
    with closing(Peer(module_site.domain)) as peer:
        yield peer
