"""The README's Python example runs as it stands, but for its size."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).parents[1]


def test_the_example_runs(tmp_path, monkeypatch):
    code = re.search(r"```python\n(.*?)```", (ROOT / "README.md").read_text(encoding="utf-8"), re.DOTALL)[1]
    shorter = {
        "chambers=6": "chambers=2",
        "steps=10": "steps=2",
        '"100 kPa"': '"40 kPa"',
        "examples/": f"{ROOT}/examples/",
    }
    for text, replacement in shorter.items():
        assert code.count(text) == 1
        code = code.replace(text, replacement)
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    exec(compile(code, "README.md", "exec"), names)
    angles = names["path"].bending_angle.to("deg").magnitude
    assert len(angles) == 2
    assert angles[1] > angles[0] > 1.0
    assert (tmp_path / "finger" / "report.html").stat().st_size > 1e6
