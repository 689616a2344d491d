"""Figures of cost in README, docs, CONTRIBUTING and ARCHITECTURE are those of docs/measured.json."""

import re
from pathlib import Path

import pytest

quoted = pytest.importorskip("benchmarks.quoted", reason="benchmarks are not beside the tests")
from benchmarks import page_code, pictures, quick_figures  # noqa: E402

TOP = Path(__file__).parents[3]
BUILT = {"_build", "gallery"}
"""Folders of docs that a build makes."""
DOCS = sorted(
    path for path in (TOP / "docs").rglob("*.*") if path.suffix in (".md", ".rst") and not BUILT & set(path.parts)
)
PAGES = [*quoted.COPIES, *DOCS]
EXAMPLES = sorted(
    path
    for folder in (TOP / "examples", *(TOP / "examples" / "gallery").iterdir())
    for path in folder.glob("*.*")
    if path.suffix in (".toml", ".py")
)
NUMBER = r"(?:\d[\d.,]*|half an?|an?|one|two|three|four|five|six|seven|eight|nine|ten|twenty|thirty|several|some|few)"
COSTS = re.compile(
    rf"(?<![\w.^/$-]){NUMBER}(?: (?:to|or|and|of) {NUMBER})?[ -](?:more |core-|CPU[ -])?"
    r"(?:(?:ms|s|min|h)(?![\w⁻^/*·-])|(?<!a )seconds?\b|(?<=half a )second\b|minutes?\b|hours?\b|days\b)"
    rf"|{NUMBER} times (?:as (?:long|fast|slow|quick)|faster|slower|quicker)"
    r"|[\d.,]+ (?:ns|µs|us|ms|kB|bytes) (?:per|for each) (?:step|grain|contact|pair|particle)"
    r"|\d{1,3}(?:,\d{3})+ (?:contact )?(?:steps|substeps)|[\d.]+ million (?:steps|substeps)|[GM]flop|per second of wall"
)
"""Times from milliseconds on, factors of speed, costs of a step, and numbers of steps.  Times of the physics of small
grains are shorter, those below are not."""
NO_COST = {
    "docs/batch.md": ("waits up to ten seconds for them",),  # a setting
    "docs/maintain.md": (
        "0.5 s each, half a minute in total",  # limits that tests keep, not measured
        "| 3 s each",
        "an hour in total on two cores",
    ),
    "docs/extend.md": ("a step of 0 s",),
    "docs/howto.md": (
        "every 30 s of wall time",  # settings
        "at least once a minute",
        "about ten times per second of wall time",
    ),
    "docs/inside.md": ("about 0.1 s of wall time", "500 such steps and 0.1 s"),
    "docs/physics/growth.md": ("0.5 ms", " at 2 ms "),  # physics
    "examples/growth-in-gas.toml": ("Between two encounters (0.5 ms)",),
    "docs/physics/dipoles.md": ("flip within 100 s", "flip within 0.2 ms"),  # physics
    "examples/charged-mixture.toml": ("1.2 times as long as wide",),
    "examples/field-off.toml": ("1.2 times as long as wide", "flip within 0.2 ms"),
    "examples/rotating-field.toml": ("1.2 times as long as wide", "flip within 0.2 ms"),
    "docs/physics/mixed-populations.md": ("a loose net of 64 grains collects 3.8 times as fast",),  # physics
    "docs/physics/rigid-clusters.md": ("until the mean cluster size is 20, after 1.2 ms",),
}
"""Texts that are no costs."""


def anchors(page: str) -> set[str]:
    """The headings of a page as they stand in links."""
    headings = re.findall(r"^#+ (.+)$", page, re.MULTILINE)
    return {re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-") for heading in headings}


def prose(path: Path) -> str:
    """The text of a page without code, formulas, copies and quotations; of a script its comments and strings."""
    text = path.read_text("utf-8")
    for wanted in NO_COST.get(path.relative_to(TOP).as_posix(), ()):
        assert wanted in text, f"{path.name} has no longer {wanted!r}: remove it from NO_COST"
        text = text.replace(wanted, "")
    if path in EXAMPLES:
        comments = re.findall(r'#.*|"""[\s\S]*?"""' if path.suffix == ".py" else "#.*", text)
        return re.sub(r"--until \S+ \S+", "", "\n".join(comments))
    text = quoted.COPY.sub(" ", text)
    text = re.sub(r"^( *)(```+)\{?[\w-]*\}?.*\n[\s\S]*?^ *\2$", "", text, flags=re.MULTILINE)
    return re.sub(r"\{\{.*?\}\}|\$\$[\s\S]*?\$\$|\$[^$\n]+\$|`[^`\n]+`", " ", text)


@pytest.mark.parametrize(
    "text",
    [
        "takes 5 s on one core",
        "three to four minutes on two cores",
        "in half an hour",
        "some 25 seconds",
        "1.1 s instead of 34 s",
        "takes 1.5 times as long",
        "25 times slower",
        "2.7 µs per grain",
        "10,355 steps",
        "6.5 million steps",
        "take six minutes of CPU",
    ],
)
def test_costs_are_found(text):
    """Checks the search of the next test."""
    assert COSTS.search(text)


@pytest.mark.parametrize(
    "text", ["within 5 µs", "20 m/s", "25 steps per period", "at 3 s⁻¹", "a step", "10 kT", "1 h^2"]
)
def test_physics_is_not_taken_for_costs(text):
    """Checks the search of the next test."""
    assert not COSTS.search(text)


@pytest.mark.parametrize("path", [*PAGES, *EXAMPLES], ids=lambda path: path.relative_to(TOP).as_posix())
def test_no_cost_is_typed_into_a_page(path):
    """Every time, factor of speed and number of steps is quoted from docs/measured.json, or not said."""
    found = [match[0] for match in COSTS.finditer(" ".join(prose(path).split()))]
    assert not found, f"{path.relative_to(TOP)}: put these figures in docs/measured.json and quote them: {found}"


@pytest.mark.parametrize("path", quoted.COPIES, ids=lambda path: path.name)
def test_copies_are_those_of_the_file(path):
    """Else: python -c 'from benchmarks import quoted; quoted.write_copies()'.  A comment at the start of a line of a
    paragraph would end it, so that only blocks of code begin with one.
    """
    page = path.read_text("utf-8")
    assert quoted.with_copies(page) == page
    assert page.count("<!-- end -->") == len(quoted.COPY.findall(page))
    assert all(
        after.startswith("\n```") for after in re.findall(r"^<!-- \w+\.\w+ -->([\s\S]{0,4})", page, re.MULTILINE)
    )


@pytest.mark.parametrize("path", quoted.COPIES, ids=lambda path: path.name)
def test_links_lead_to_files(path):
    """Relative links, headings in them, and pictures of the pages at the top."""
    links = re.findall(r"\]\((?!\w+:|#)([^)#\s]+)(?:#([^)\s]+))?", path.read_text("utf-8"))
    assert not [link for link, _ in links if not (TOP / link).is_file()]
    assert not [(link, to) for link, to in links if to and to not in anchors((TOP / link).read_text("utf-8"))]
    assert path.name != "README.md" or pictures.PAGE.relative_to(TOP).as_posix() in dict(links)


def test_the_keys_of_the_picture_are_those_that_readme_names():
    """The picture is made with `Z` and as many `[` as README says in words."""
    (first, *others), text = pictures.KEYS, (TOP / "README.md").read_text("utf-8")
    assert set(others) == {"["} and len(others) == 6
    assert f"after the keys `{first}`" in text and "six times `[`" in text


def test_a_changed_figure_is_noticed():
    """Checks the helper of the test before: another number, and another line of a block."""
    time = quoted.quotable()["main_job"]["time"]
    assert (
        quoted.with_copies("x <!-- main_job.time -->0 s<!-- end -->") == f"x <!-- main_job.time -->{time}<!-- end -->"
    )
    block = "<!-- script.printed -->\n```text\nold\n```\n<!-- end -->"
    assert quoted.with_copies(block) == block.replace("old", quoted.quotable()["script"]["printed"])


def test_pages_quote_what_is_there_and_all_of_it():
    """Every quotation names a value, and every value and table is quoted; each record says how it was measured."""
    values = quoted.quotable()
    names = {name for path in DOCS for name in quoted.QUOTE.findall(path.read_text("utf-8"))}
    names |= {name for path in quoted.COPIES for name, _ in quoted.COPY.findall(path.read_text("utf-8"))}
    for name in names - {"sources"}:
        record, _, key = name.partition(".")
        assert key in values[record], name
    records = quoted.read()
    there = {f"{name}.{key}" for name, one in records.items() for key in one.get("values", ())}
    there |= {f"{name}.table" for name, one in records.items() if "rows" in one}
    assert not there - names, f"never quoted: {sorted(there - names)}"
    for name, one in records.items():
        assert all(one[key] for key in quoted.ABOUT), name
        assert all(len(row) == len(one["columns"]) for row in one.get("rows", ())), name


def test_the_file_is_written_as_it_is_read(tmp_path, monkeypatch):
    """Writing and reading gives the same records, one line for each value."""
    records = quoted.read()
    before = quoted.FILE.read_text("utf-8")
    monkeypatch.setattr(quoted, "FILE", tmp_path / "measured.json")
    quoted.write(records)
    assert quoted.read() == records
    assert quoted.FILE.read_text("utf-8") == before


def test_figures_are_written_with_their_unit():
    """Counts with commas, times with two digits, texts as they are."""
    assert [quoted.text_of(value) for value in ([10355, ""], [4.7, "s"], "1.5 times")] == [
        "10,355",
        "4.7 s",
        "1.5 times",
    ]
    assert [quick_figures.duration(t) for t in (0.104, 4.68, 25.6, 270.0)] == [
        [0.1, "s"],
        [4.7, "s"],
        [26, "s"],
        [4.5, "minutes"],
    ]


def test_the_first_page_has_the_script_of_the_readme():
    """The same lines, without the call that opens a browser."""
    (script,) = page_code.scripts(TOP / "README.md")
    lines = [line for line in script.splitlines() if not line.startswith("sim.view()")]
    assert "\n".join(lines) + "\n" in page_code.cells(quick_figures.FIRST_PAGE)
