"""The pages of docs/notebooks hold the notebooks' cells, so that none is left from an older notebook."""
import json
import os
import pathlib
import re

import pytest

ROOT = pathlib.Path(os.environ.get("MVSTUDIO_SOURCE", pathlib.Path(__file__).resolve().parents[2]))
NOTEBOOKS = sorted((ROOT / "python/notebooks").glob("*.ipynb"))


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_page_has_the_notebooks_cells(path):
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    page = (ROOT / f"docs/notebooks/{path.stem}.md").read_text(encoding="utf-8")
    code = ["".join(cell["source"]).removeprefix("%%bash").strip() for cell in cells if cell["cell_type"] == "code"]
    shown = re.findall(r"^```(?:python|bash)\n(.*?)\n```$", page, flags=re.S | re.M)
    assert shown == code, "run scripts/notebooks"
    for cell in cells:
        if cell["cell_type"] == "markdown":
            assert all(line in page for line in "".join(cell["source"]).splitlines()), "run scripts/notebooks"
    assert not any(cell.get("outputs") for cell in cells), "notebooks are kept without outputs"
    assert not re.search(r"/tmp/|/home/|/root/|Traceback", page)


def test_every_page_has_its_notebook():
    assert len(NOTEBOOKS) == 4
    assert {path.stem for path in NOTEBOOKS} == {page.stem for page in (ROOT / "docs/notebooks").glob("*.md")}
