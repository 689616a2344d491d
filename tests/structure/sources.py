"""Syntax trees of the sources and the tests, parsed once for all tests of their structure."""

from __future__ import annotations

import ast
from functools import cache
from pathlib import Path

from .layers import SOURCE, TOP

SOURCES = sorted(SOURCE.rglob("*.py"))
UNIT_TESTS = sorted((TOP / "tests" / "unit").rglob("*.py"))


@cache
def text_of(path: Path) -> str:
    """The text of a file."""
    return path.read_text("utf-8")


@cache
def nodes_of(path: Path) -> tuple[ast.AST, ...]:
    """All nodes of the syntax tree of a file; the first one is the module."""
    return tuple(ast.walk(ast.parse(text_of(path))))


@cache
def identifiers(path: Path) -> frozenset[str]:
    """Names of modules, functions, classes, arguments, variables and attributes in a file."""
    found = set[str]()
    for node in nodes_of(path):
        for key in ("name", "asname", "id", "arg", "attr", "module"):
            if isinstance(value := getattr(node, key, None), str):
                found.update(value.split("."))
    return frozenset(found)
