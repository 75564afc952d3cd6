"""The notebook of the examples runs as it stands, shows its tables and leaves what it says."""

import sys
from pathlib import Path

import nbformat
import pytest
from jupyter_client import KernelManager
from nbclient import NotebookClient

EXAMPLES = Path(__file__).parent.parent / "examples"


class OwnPython(KernelManager):
    """Starts the kernel with the Python that runs the tests, whatever kernels the computer knows."""

    def format_kernel_cmd(self, extra_arguments=None):
        """Return the command of the kernel."""
        return [sys.executable, "-m", "ipykernel_launcher", "-f", self.connection_file]


@pytest.mark.long
def test_the_notebook_runs_from_its_first_cell_to_its_last():
    book = nbformat.read(EXAMPLES / "measured_run.ipynb", as_version=4)
    assert not any(c.get("outputs") for c in book.cells)  # what is shown is made anew
    client = NotebookClient(
        book, timeout=500, resources={"metadata": {"path": str(EXAMPLES)}}, kernel_manager_class=OwnPython
    )
    client.execute()
    shown = [o for c in book.cells for o in c.get("outputs", ())]
    printed = "".join(o["text"] for o in shown if o["output_type"] == "stream" and o["name"] == "stdout")
    assert "verdict" in printed
    data = [o["data"] for o in shown if o["output_type"] == "execute_result"]
    assert sum("held_out_mean_mm" in d.get("text/html", "") for d in data) == 1
    assert any("image/png" in d for d in data)
    assert "'robot.toml'" in data[-1]["text/plain"]
