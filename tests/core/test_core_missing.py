import subprocess
import sys

HIDE = """
import sys
sys.modules["fsoe_net.core._core"] = None
from fsoe_net.core.core import CorePlan
from fsoe_net.errors import CoreMissing, EnvironmentFault
try:
    CorePlan.load(b"")
except CoreMissing as exc:
    assert isinstance(exc, EnvironmentFault)
    print(exc)
"""


def test_import_works_without_the_compiled_part_and_first_use_states_how_to_get_it() -> None:
    done = subprocess.run([sys.executable, "-c", HIDE], capture_output=True, text=True, check=True)
    assert "compiled part" in done.stdout
    assert "pip install" in done.stdout
