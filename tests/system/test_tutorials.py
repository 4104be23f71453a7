"""Every notebook of the tutorials runs."""

import pytest

from pages import ROOT

NOTEBOOKS = sorted((ROOT / "docs" / "tutorials").glob("*.ipynb"))


@pytest.mark.slow
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs(path, monkeypatch):
    pytest.importorskip("ipykernel", reason="needs pip install 'spisim[docs]'")
    pytest.importorskip("nbclient", reason="needs pip install 'spisim[docs]'")
    if "import torch" in path.read_text(encoding="utf-8"):
        pytest.importorskip("torch", reason="needs pip install 'spisim[torch]'")
    import run_tutorials

    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    monkeypatch.setenv("MPLBACKEND", "module://matplotlib_inline.backend_inline")
    run_tutorials.run(path)
