"""Warnings about a run, each shown once."""

from __future__ import annotations

from collections.abc import Iterable

from ..basics.errors import warn
from ..engine.engine import Engine
from ..limits.solid_limits import extreme_warnings


class RunWarnings:
    """Warnings about a simulation so far, also before it was resumed.

    Attributes
    ----------
    texts : list[str]
        Their texts, the first one first.
    kinds : set[str]
        Kinds of texts of which the first one was shown.
    """

    def __init__(self, texts: Iterable[str] = ()):
        self.texts = list(texts)
        self.kinds: set[str] = set()

    def show(self, text: str, about: str = "") -> None:
        """Warn once of each text, and of one text that begins with `about`; of these the latest is kept."""
        earlier = [k for k, one in enumerate(self.texts) if one == text or (about and one.startswith(about))]
        if earlier:
            self.texts[earlier[0]] = text
            return
        self.texts.append(text)
        warn(text)

    def show_first(self, kind: str, text: str) -> None:
        """Warn unless a text of this kind, or one that begins with it, was shown; that text is kept."""
        if kind not in self.kinds and not any(one.startswith(kind) for one in self.texts):
            self.kinds.add(kind)
            self.show(text)

    def take(self, engine: Engine) -> None:
        """Warn of what an engine has found."""
        while engine.warnings:
            self.show(engine.warnings.pop(0))
        for about, text in extreme_warnings(engine.stored_state.clock).items():
            self.show(text, about)
