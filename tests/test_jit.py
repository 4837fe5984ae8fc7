import subprocess
import sys
from pathlib import Path

import pytest

from hose_mj import jit

LOWER = "from hose_mj.jit import kernel\n\n@kernel\ndef lower(x):\n    return x + {}\n"
UPPER = """from hose_mj.jit import kernel
from hose_mj.{}.lower import lower

@kernel
def upper(x):
    return 10.0 * lower(x)
"""


@pytest.mark.parametrize(("below", "above"), [("part", "part"), ("hoses", "validation")])
def test_a_change_in_an_inlined_kernel_of_another_file_is_noticed(tmp_path, below, above):
    # A copy of jit.py in a package of its own, so that its root is this folder.
    package = tmp_path / "hose_mj"
    for folder in (package, package / below, package / above):
        folder.mkdir(exist_ok=True)
        (folder / "__init__.py").touch()
    source = Path(jit.__file__).read_text(encoding="utf-8")
    (package / "jit.py").write_text(source, encoding="utf-8")
    (package / above / "upper.py").write_text(UPPER.format(below), encoding="utf-8")
    program = f"from hose_mj.{above}.upper import upper; print(upper(1.0), upper.stats.cache_hits)"
    said = []
    for number in (1, 1, 2, 1):
        (package / below / "lower.py").write_text(LOWER.format(number), encoding="utf-8")
        command = [sys.executable, "-c", program]
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
        said.append(done.stdout.split(" ", 1))
    assert [answer for answer, _ in said] == ["20.0", "20.0", "30.0", "20.0"]
    # Both versions stay on the disk, so going back costs nothing.
    assert [("float64" in hits) for _, hits in said] == [False, True, False, True]
