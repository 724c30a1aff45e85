"""The wear estimate at full size: generate, train, judge on held-out machine draws.

    python tests/benchmarks/standard_pump.py [--records 2000] [--folder /tmp/standard]

Needs 3 GB of disk for 2,000 records and takes about three minutes on two cores. An unfinished
data set in the folder is gone on with, a finished one is used as it is.
"""

import argparse
import json
import time
from pathlib import Path

from wearstate.datasets.generate import generate
from wearstate.diagnose.evaluate import score
from wearstate.diagnose.train import train_model

RECIPE = "bilge-pump-standard"


def measure(folder: Path, records: int, jobs: int) -> dict[str, object]:
    """Held-out figures and the seconds of each stage; all recordings are simulated."""
    folder.mkdir(parents=True, exist_ok=True)
    data = folder / f"{RECIPE}-{records}.h5"
    seconds = {}
    start = time.perf_counter()
    if not data.exists():
        generate(RECIPE, records, data, seed=0, jobs=jobs)
        seconds["generate"] = round(time.perf_counter() - start, 1)
    start = time.perf_counter()
    model, table, test = train_model(data, jobs=jobs)
    seconds["features and training"] = round(time.perf_counter() - start, 1)
    return {"recipe": RECIPE, "held_out": score(model, table, test), "seconds": seconds}


def main() -> None:
    """Print the figures as JSON."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--records", type=int, default=2000)
    parser.add_argument("--folder", type=Path, default=Path("benchmark-data"))
    parser.add_argument("--jobs", type=int, default=2)
    options = parser.parse_args()
    print(json.dumps(measure(options.folder, options.records, options.jobs), indent=1))


if __name__ == "__main__":
    main()
