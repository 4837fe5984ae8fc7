"""Writes assets/compare/cable.json: MuJoCo's cable in the cases of `hose-mj compare --quick`.

MuJoCo 4 has no composite cable; there `hose-mj compare` shows these runs, marked as committed. Run
it with MuJoCo 3. Times are those of the thread, which a machine that is shared lengthens less:

    python -m tools.commit_cable
"""

from __future__ import annotations

import json
import time
from importlib.metadata import version

from hose_mj.assets import find_assets
from hose_mj.recording.document import describe_machine
from hose_mj.recording.files import write_atomically
from hose_mj.validation import run
from hose_mj.validation.cases import find_cases
from hose_mj.validation.study import run_study

COLUMNS = (
    *("case", "model", "scheme", "resolution", "timestep", "error", "reference"),
    *("clamp_corrected", "wall_s_per_sim_s", "wall_s", "fallbacks"),
)


class ThreadClock:
    """Stands in for the module `time` where runs are timed."""

    perf_counter = staticmethod(time.thread_time)


def main() -> None:
    """Runs the cable and writes the file, a row a line."""
    vars(run)["time"] = ThreadClock
    cases = tuple(case for case in find_cases(()) if "cable" in case.models)
    study = run_study(
        cases, ("cable",), quick=True, seed=0, with_numerics=False, advance=lambda text: print(text)
    )
    rows = [[record[name] for name in COLUMNS] for record in study.list_records()]
    head = {
        "mujoco": version("mujoco"),
        "cpu": describe_machine()["cpu"],
        "clock": "thread",
        "columns": COLUMNS,
    }
    text = json.dumps(head)[:-1] + ', "rows": [\n' + ",\n".join(map(json.dumps, rows)) + "\n]}\n"
    write_atomically(find_assets() / "compare" / "cable.json", text.encode())


if __name__ == "__main__":
    main()
