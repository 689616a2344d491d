"""Packages whose public names are imported on first use."""

import importlib
import pkgutil
from types import ModuleType

import pytest

import sand

PACKAGES = [one.name for one in pkgutil.walk_packages(sand.__path__, "sand.") if one.ispkg]
LAZY = ["sand", *(name for name in PACKAGES if hasattr(importlib.import_module(name), "__getattr__"))]


@pytest.mark.parametrize("name", LAZY)
def test_dir_lists_the_public_names(name):
    """All of them can be had, and each belongs to the package: nothing that the package itself imports is listed."""
    package = importlib.import_module(name)
    listed = dir(package)
    assert listed == sorted(listed) and len(listed) > 5
    for one in listed:
        found = getattr(package, one)
        own = found.__name__ if isinstance(found, ModuleType) else getattr(found, "__module__", "sand")
        assert own.startswith(("sand.", name)) and (one == "__version__" or one[0] != "_"), one
    with pytest.raises(AttributeError, match=f"module '{name}' has no 'nothing'; allowed: .*"):
        package.nothing  # noqa: B018


def test_the_lazy_packages_are_known():
    """Those that the documentation names as such."""
    assert {"sand", "sand.analysis", "sand.experiments", "sand.experiments.scattering"} <= set(LAZY)
