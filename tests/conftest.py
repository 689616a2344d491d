"""What all tests share."""

from __future__ import annotations

import signal
import warnings
from collections.abc import Iterator

import pytest

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # as in a background job of a shell; tests press Ctrl-C
    signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--validate", action="store_true", help="also run the long statistical checks")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    if config.getoption("--validate"):
        return
    skip = pytest.mark.skip(reason="long statistical check; run with --validate")
    for item in items:
        if "validate" in item.keywords:
            item.add_marker(skip)


@pytest.fixture(autouse=True)
def _no_browser(monkeypatch: pytest.MonkeyPatch) -> None:
    """Tests open no windows."""
    monkeypatch.setenv("SAND_NO_BROWSER", "1")


@pytest.fixture(autouse=True)
def _no_physics_warnings() -> Iterator[None]:
    """Small iron grains warn about JKR's validity; tests of that warning look for it themselves."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="contacts of .* grains")
        yield
