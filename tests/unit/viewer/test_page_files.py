"""The page bundle is read where it was built; a missing bundle gives one line with the reason."""

from pathlib import Path

import pytest

from sand.basics.errors import BadInput
from sand.io import page_bundle as page


def test_bundle_is_read(tmp_path):
    (tmp_path / "grainview.js").write_text("let µ = 1;\n", "utf-8")
    (tmp_path / "grainview.css").write_text("body {}\n")
    (tmp_path / "missing.txt").write_text("an old reason.\n")  # of a failed build before the developer's own
    assert page.read_bundle(tmp_path) == ("let µ = 1;\n", "body {}\n")


@pytest.mark.parametrize("there", [(), ("grainview.js",), ("grainview.css",)])
def test_missing_bundle_is_one_line_with_the_reason(tmp_path, there):
    """An incomplete bundle counts as missing."""
    for name in there:
        (tmp_path / name).write_text("x")
    with pytest.raises(BadInput) as caught:
        page.read_bundle(tmp_path)
    assert "It was not built when SAND was installed." in str(caught.value)
    (tmp_path / "missing.txt").write_text("npm failed: no network.\n")
    with pytest.raises(BadInput) as caught:
        page.read_bundle(tmp_path)
    assert len(caught.value.problems) == 1 and "\n" not in str(caught.value)
    assert "npm failed: no network." in str(caught.value) and "pip" in str(caught.value)


def test_remedy_fits_the_installation(tmp_path, monkeypatch):
    """In a clone the sources can be bundled; elsewhere SAND must be reinstalled."""
    folder = tmp_path / "src" / "sand" / "viewer" / "page"
    monkeypatch.setattr(page, "PAGE", folder)
    with pytest.raises(BadInput, match="--force-reinstall"):
        page.read_bundle(folder)
    (tmp_path / "grainview").mkdir()
    (tmp_path / "grainview" / "package.json").write_text("{}")
    with pytest.raises(BadInput, match="npm run build"):
        page.read_bundle(folder)


def test_build_hook_and_reader_use_the_same_folder():
    """The hook writes where `read_bundle` reads."""
    hook = (Path(__file__).parents[3] / "hatch_build.py").read_text("utf-8")
    assert 'PAGE = Path("src", "sand", "viewer", "page")' in hook
    assert page.PAGE.parts[-3:] == ("sand", "viewer", "page")
