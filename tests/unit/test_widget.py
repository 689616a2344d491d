"""The widget of a notebook: what it answers."""

import json

import pytest

import sand
from sand.viewer import show
from sand.viewer.dataset import run_dataset
from sand.viewer.notebook import answer_message, widget

from .pages import SCRIPT, decode

pytestmark = pytest.mark.usefixtures("bundle")


@pytest.mark.compiled("fields")
def test_messages_of_the_widget(finished_run):
    """Each message is answered from the run dataset, with its id, so that the page knows what it asked for."""
    story = run_dataset(finished_run[0])
    assert answer_message(story, {"kind": "grains", "id": 7}) == ({"kind": "grains", "id": 7}, [story.grains()])
    assert answer_message(story, {"kind": "frame", "k": 2}) == ({"kind": "frame", "k": 2}, [story.frame(2)])
    told, none = answer_message(story, {"kind": "manifest", "since": 4})
    assert len(told["manifest"]["times"]) == 2 and none == []
    assert answer_message(story, {"kind": "series"})[0]["series"] == json.loads(json.dumps(story.series()))
    assert "reason" in answer_message(story, {"kind": "dimension", "k": 5, "grain": 0})[0]


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
    """A sentence, whatever comes; nothing is raised in the kernel."""
    told, buffers = answer_message(run_dataset(finished_run[0]), content)
    assert isinstance(told["error"], str) and buffers == []


@pytest.mark.compiled("fields")
def test_what_nobody_thought_of(finished_run, monkeypatch):
    """Any error is answered with a sentence, so that the page does not wait for ever."""
    story = run_dataset(finished_run[0])
    monkeypatch.setattr(story, "frame", lambda k: 1 / 0)
    told, buffers = answer_message(story, {"kind": "frame", "k": 1, "id": 3})
    assert told["id"] == 3 and "ZeroDivisionError" in told["error"] and buffers == []


@pytest.mark.compiled("fields")
def test_the_widget(finished_run, monkeypatch):
    """It holds nothing that would be saved with the notebook, runs the bundle, and answers through its own channel."""
    pytest.importorskip("anywidget", reason="anywidget is in the test extra")
    one = widget(run_dataset(finished_run[0]))
    assert not {"manifest", "series"} & set(one.get_state()) and SCRIPT in str(one._esm)
    sent = []
    monkeypatch.setattr(one, "send", lambda content, buffers=None: sent.append((content, buffers)))
    one._handle_custom_msg({"kind": "frame", "k": 1}, [])
    assert sent[0][0] == {"kind": "frame", "k": 1} and decode(sent[0][1][0])[0]["frame"] == 1
    monkeypatch.setattr(show, "in_notebook", lambda: True)
    assert type(sand.open(finished_run[0]).view()).__name__ == "GrainWidget"
