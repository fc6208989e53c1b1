"""A training in a process of its own: it yields to estimates, and takes its memory along.

The process knows no store. It reads its plan from stdin, tells its progress and what came of it on
stdout, a line of JSON each. It rests between two steps when stdin says so, and ends when that does:
when its worker ends, in whatever way.
"""

import json
import logging
import os
import sys
import threading
import time
from dataclasses import asdict
from pathlib import Path
from typing import Any

from service.logs import configure_logs
from service.workers.processes.process import limit_memory, settle_allocator, yield_to_others

log = logging.getLogger("surefoot.jobs")
_TELLS_EVERY_S = 0.25
REST, GO_ON = "rest", "go on"  # what a training is told, beside its order
_going = threading.Event()
_going.set()


def main() -> None:
    """Carry out the training that stdin describes."""
    tells = os.fdopen(os.dup(sys.stdout.fileno()), "w", buffering=1)
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # what libraries print is no answer
    order = json.loads(sys.stdin.buffer.readline())
    threading.Thread(target=_heed_stdin, daemon=True).start()
    # Beside this, even the idle class would let a busy machine stop trainings for good.
    yield_to_others(order["nice"])
    settle_allocator()
    limit_memory(None)  # the worker's, which started it
    configure_logs()
    tells.write(json.dumps(_train(order, tells)) + "\n")


def _train(order: dict[str, Any], tells: Any) -> dict[str, Any]:
    import torch

    from models.errors import CalibrationError
    from models.regression.checkpoint import save_weights
    from models.regression.recipe import TrainingProgress, plan_from_config
    from models.regression.training import check_held_out, train

    told_s = 0.0

    def report(progress: TrainingProgress) -> None:
        nonlocal told_s
        _going.wait()
        if time.monotonic() - told_s >= _TELLS_EVERY_S:
            told_s = time.monotonic()
            tells.write(json.dumps({"progress": asdict(progress)}) + "\n")

    torch.set_num_threads(order["threads"])
    try:
        network, metrics = train(plan_from_config(order["config"]), report)
        check_held_out(metrics)
        digest = save_weights(network, Path(order["weights_dir"]))
    except CalibrationError as error:
        return {"error": str(error)}
    except Exception as error:
        log.exception("training_failed")
        return {"error": repr(error)}
    return {"weights_sha256": digest, "metrics": asdict(metrics)}


def _heed_stdin() -> None:
    """Rest and go on as the worker says, and end when it does."""
    for line in sys.stdin.buffer:
        if line.strip().decode() == REST:
            _going.clear()
        else:
            _going.set()
    os._exit(1)


if __name__ == "__main__":
    main()
