"""Pages of a run taken apart."""

import base64
import gzip
import json
import re
from pathlib import Path

from sand.viewer.packets import decode

SCRIPT = "const a = '</script><!-- ${x}'; console.log(a)"
"""What a script may hold that would end its element."""


def elements(path):
    """Type and content of each script element, by id, as a browser splits them; "" for the page's own."""
    text = Path(path).read_text(encoding="utf-8")
    found = re.findall(r'<script type="([^"]*)"(?: id="([^"]*)")?>(.*?)</script', text, re.DOTALL | re.IGNORECASE)
    assert len({key for _, key, _ in found}) == len(found)
    return {key: (kind, content) for kind, key, content in found}


def blocks(path):
    """Manifest, series and packets of a page."""
    found = elements(path)
    told = {key: json.loads(found[f"sand-{key}"][1]) for key in ("manifest", "series")}
    packets = [
        decode(gzip.decompress(base64.b64decode(content)))
        for key, (kind, content) in found.items()
        if kind == "application/octet-stream" and key.startswith("sand-frame-")
    ]
    return told["manifest"], told["series"], packets
