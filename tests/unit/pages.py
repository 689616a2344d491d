"""Decoding of packets and HTML pages of a run."""

import base64
import gzip
import json
import re
from pathlib import Path

import numpy as np

from sand.viewer.packets import MAGIC, TYPES

SCRIPT = "const a = '</script><!-- ${x}'; console.log(a)"
"""Text in a script that would end its element."""


def decode(packet):
    """Header of a packet, and its arrays by name; floats as float64."""
    assert packet[:8] == MAGIC
    start = 12 + int.from_bytes(packet[8:12], "little")
    header, arrays = json.loads(packet[12:start]), {}
    for entry in header["arrays"]:
        kind, shape = TYPES[entry["type"]], entry["shape"]
        stored = np.frombuffer(packet, kind, int(np.prod(shape)), start + entry["offset"]).reshape(shape)
        arrays[entry["name"]] = stored.astype(np.float64) * entry.get("scale", 1.0) if kind.kind == "f" else stored
    return header, arrays


def elements(path):
    """Type and content of each script element, by id, as a browser splits them; id "" for the page's own script."""
    text = Path(path).read_text(encoding="utf-8")
    found = re.findall(r'<script type="([^"]*)"(?: id="([^"]*)")?>(.*?)</script', text, re.DOTALL | re.IGNORECASE)
    assert len({key for _, key, _ in found}) == len(found)
    return {key: (kind, content) for kind, key, content in found}


def blocks(path):
    """Manifest, series and packets of a page."""
    found = elements(path)
    header_bytes = {key: json.loads(found[f"sand-{key}"][1]) for key in ("manifest", "series")}
    packets = [
        decode(gzip.decompress(base64.b64decode(content)))
        for key, (kind, content) in found.items()
        if kind == "application/octet-stream" and key.startswith("sand-frame-")
    ]
    return header_bytes["manifest"], header_bytes["series"], packets
