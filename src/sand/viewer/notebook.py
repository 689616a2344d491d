"""The viewer page as a notebook widget: an anywidget that requests frames from the kernel."""

from __future__ import annotations

import importlib.util
from typing import Any

from ..basics.errors import BadInput
from ..io.page_bundle import read_bundle
from ..io.run_folder import plain
from .dataset import REQUESTS, RunDataset


def has_widgets() -> bool:
    """Whether anywidget is installed."""
    return importlib.util.find_spec("anywidget") is not None


def widget(dataset: RunDataset) -> Any:
    """Create a widget that shows a dataset.

    Raises
    ------
    BadInput
        If the viewer page is not installed.
    """
    import anywidget  # an optional dependency

    script, styles = read_bundle()

    class GrainWidget(anywidget.AnyWidget):
        """Animated view of the grains of a run.

        Messages from the page, such as {"kind": "frame", "k": 3}, are answered by `answer_message`.

        Parameters
        ----------
        dataset : RunDataset
            Data of the run.
        """

        _esm, _css = script, styles

        def __init__(self, dataset: RunDataset):
            super().__init__()
            self._dataset = dataset
            self.on_msg(self._on_message)

        def _on_message(self, _: Any, content: Any, buffers: Any) -> None:
            self.send(*answer_message(self._dataset, content))

    return GrainWidget(dataset)


def answer_message(dataset: RunDataset, content: Any) -> tuple[dict[str, Any], list[bytes]]:
    """Answer a message of the widget (format: grainview/README.md).

    Returns
    -------
    tuple of (dict, list of bytes)
        The message with the result or an `error` text added, and the packet as the first buffer, if any.
    """
    request = content if isinstance(content, dict) else {}
    kind = request.get("kind")
    echo = {key: request[key] for key in ("kind", "k", "grain", "since", "id") if key in request}
    try:
        if kind not in REQUESTS:
            raise BadInput(f"kind = {kind!r}; allowed: {', '.join(REQUESTS)}")
        answer = dataset.answer(kind, *(_index(request, name) for name in REQUESTS[kind]))
        if isinstance(answer, bytes):
            return echo, [answer]
        return echo | plain(answer if kind == "dimension" else {kind: answer}), []
    except BadInput as error:
        return echo | {"error": str(error)}, []
    except Exception as error:  # the page waits for an answer in any case
        return echo | {"error": f"internal error ({type(error).__name__}: {error})"}, []


def _index(request: dict[str, Any], key: str) -> int:
    """A non-negative integer of a message; `since` is optional."""
    value = request.get(key, 0 if key == "since" else None)
    if isinstance(value, bool) or not isinstance(value, int) or value < 0:
        raise BadInput(f"{key} = {value!r} must be an integer of at least 0")
    return value
