"""The notebook widget: its responses to messages of the page."""

import json

import pytest

import sand
from sand.viewer import show
from sand.viewer.dataset import run_dataset
from sand.viewer.notebook import answer_message, widget

from ..pages import SCRIPT, decode

pytestmark = pytest.mark.usefixtures("bundle")


@pytest.mark.compiled("fields")
def test_messages_of_the_widget(finished_run):
    """Each message is answered from the run dataset, with the id of the request."""
    dataset = run_dataset(finished_run[0])
    assert answer_message(dataset, {"kind": "grains", "id": 7}) == ({"kind": "grains", "id": 7}, [dataset.grains()])
    assert answer_message(dataset, {"kind": "frame", "k": 2}) == ({"kind": "frame", "k": 2}, [dataset.frame(2)])
    reply, none = answer_message(dataset, {"kind": "manifest", "since": 4})
    assert len(reply["manifest"]["times"]) == 2 and none == []
    assert answer_message(dataset, {"kind": "series"})[0]["series"] == json.loads(json.dumps(dataset.series()))
    assert "reason" in answer_message(dataset, {"kind": "dimension", "k": 5, "grain": 0})[0]


@pytest.mark.compiled("fields")
@pytest.mark.parametrize(
    "content",
    [
        None,
        {},
        {"kind": "file"},
        {"kind": "frame"},
        {"kind": "frame", "k": -1},
        {"kind": "frame", "k": 6},
        {"kind": "frame", "k": "0"},
        {"kind": "frame", "k": True},
        {"kind": "dimension", "k": 0, "grain": 6},
        {"kind": "manifest", "since": None},
    ],
)
def test_wrong_messages(finished_run, content):
    """Any content gives a sentence; nothing is raised in the kernel."""
    reply, buffers = answer_message(run_dataset(finished_run[0]), content)
    assert isinstance(reply["error"], str) and buffers == []


@pytest.mark.compiled("fields")
def test_unexpected_errors_are_answered(finished_run, monkeypatch):
    """Any error gives a sentence, so that the page does not wait forever."""
    dataset = run_dataset(finished_run[0])
    monkeypatch.setattr(dataset, "frame", lambda k: 1 / 0)
    reply, buffers = answer_message(dataset, {"kind": "frame", "k": 1, "id": 3})
    assert reply["id"] == 3 and "ZeroDivisionError" in reply["error"] and buffers == []


@pytest.mark.compiled("fields")
def test_the_widget(finished_run, monkeypatch):
    """Its state is not saved with the notebook, it runs the bundle, and answers through its own channel."""
    pytest.importorskip("anywidget", reason="anywidget is in the test extra")
    one = widget(run_dataset(finished_run[0]))
    assert not {"manifest", "series"} & set(one.get_state()) and SCRIPT in str(one._esm)
    sent = []
    monkeypatch.setattr(one, "send", lambda content, buffers=None: sent.append((content, buffers)))
    one._handle_custom_msg({"kind": "frame", "k": 1}, [])
    assert sent[0][0] == {"kind": "frame", "k": 1} and decode(sent[0][1][0])[0]["frame"] == 1
    monkeypatch.setattr(show, "in_notebook", lambda: True)
    assert type(sand.open(finished_run[0]).view()).__name__ == "GrainWidget"
