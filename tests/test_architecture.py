"""The house's arrows, read from the imports."""

import ast
import subprocess
import sys
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

from tests.conftest import ROOT

# Rooms, from the ground up: a room may import those before it, and itself.
SERVICE_ROOMS = [
    {"data_dir", "interpreter", "setting_values", "addresses", "enums", "degrees"},
    {"settings", "errors", "logs", "reasons"},
    {"formats", "store"},
    {"wording", "job_queue"},
    {"access"},
    {"estimate_queue", "references", "notifications"},
    {"alerts", "training"},
    {"cameras", "estimation"},
    {"reports"},
    {"operations", "workers"},
    {"api"},
    {"pages"},
    {"app"},
    {"commands"},
    {"cli"},
]
MODEL_ROOMS = [
    {"errors", "reasons"},
    {"code_files", "effort"},
    {"compiled"},
    {"serialization", "quantiles", "durations"},
    {"geometry"},
    {"rows"},
    {"pictures"},
    {"tracks"},
    {"simulation"},
    {"walking"},
    {"regression"},
    {"paths"},
    {"monitoring"},
    {"pose"},
    {"assessment"},
]
# What the service asks of models, and nothing deeper: by module, what for.
PUBLIC_MODELS = {
    "models.assessment": "the one way to the answer whether a camera moved, and where it is now",
    "models.durations": "hours and days in seconds",
    "models.effort": "the CPU time that a look may take",
    "models.errors": "what a calibration may fail by",
    "models.geometry.crossings": "who crosses a line, and who would if it lay elsewhere",
    "models.geometry.footprint": "the ground in the picture",
    "models.geometry.ground": "feet, horizons and people who are placed wrong",
    "models.geometry.ground_homography": "a pose that is given by a homography",
    "models.geometry.hints": "what a person marks in a picture",
    "models.geometry.intrinsics": "the lens",
    "models.geometry.lens_checks": "lenses that no camera has, and likely mistakes",
    "models.geometry.lens_forms": "the lens as installers know it",
    "models.geometry.outlines": "zones after a move",
    "models.geometry.pose": "the pose, its parameters and their names",
    "models.geometry.propagation": "how far off points are by a pose",
    "models.geometry.rotation": "arrays; forms of a rotation that people register",
    "models.geometry.upright": "upper edges of boxes, as they are stored",
    "models.geometry.usual_pose": "the pose of a camera that nobody has calibrated",
    "models.monitoring.arrivals": "rhythms of people, and silences",
    "models.monitoring.drift": "the drift and its limits, without what estimates it",
    "models.pictures": "the turn between two pictures, a gallery, what is wrong with one",
    "models.pose": "a site, an estimate, an alarm: all that they take, give and keep",
    "models.quantiles": "the 90 % interval, for words",
    "models.reasons": "reasons, which are told and stored",
    "models.regression.averaging": "the regressor's estimate beside the served one",
    "models.regression.checkpoint": "weights, safely read and written",
    "models.regression.network": "predictions of a trained regressor",
    "models.regression.recipe": "the recipe of a training, weights by their hash; without torch",
    "models.regression.training": "a training",
    "models.simulation.poses": "a knock; the demo's camera, as often as people pass it",
    "models.simulation.walkers": "the demo's people; how fast a site's walk",
    "models.tracks.image_size": "the image size that the numbers of tracks belong to",
    "models.tracks.scaling": "from the numbers of another image to the pixels of a frame",
    "models.tracks.scenes": "recorded scenes, to replay",
    "models.tracks.trajectory": "the track, and how long one must be",
    "models.walking.config": "how few people tell something",
}
TORCH_ROOMS = {"models/regression", "service/workers"}


def sources(top: str) -> list[Path]:
    return sorted((ROOT / top).rglob("*.py"))


@cache
def imports(path: Path) -> frozenset[str]:
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            found |= {f"{node.module}.{alias.name}" for alias in node.names} | {node.module}
    return frozenset(found)


def room(name: str) -> str:
    return name.split(".")[1]


@pytest.mark.parametrize(
    ("top", "below"), [("models", {"models"}), ("surefoot", {"models", "surefoot"})]
)
def test_models_and_the_python_face_import_nothing_above_them(top, below):
    ours = {"models", "surefoot", "service", "studies", "migrations", "tests"}
    for path in sources(top):
        assert {name.split(".")[0] for name in imports(path)} & ours <= below, path


def test_the_service_asks_nothing_deeper_than_the_public_modules_of_models():
    asked = set()
    for path in sources("service"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("models"):
                asked.add(node.module)
            elif isinstance(node, ast.Import):
                asked |= {alias.name for alias in node.names if alias.name.startswith("models")}
    assert asked == set(PUBLIC_MODELS)
    assert list(PUBLIC_MODELS) == sorted(PUBLIC_MODELS)


def test_nothing_that_is_shipped_imports_a_study():
    for top in ("surefoot", "models", "service", "migrations"):
        for path in sources(top):
            assert not [name for name in imports(path) if name.split(".")[0] == "studies"], path


@pytest.mark.parametrize(("top", "rooms"), [("models", MODEL_ROOMS), ("service", SERVICE_ROOMS)])
def test_arrows_go_down_only(top, rooms):
    level = {name: number for number, names in enumerate(rooms) for name in names}
    for path in sources(top):
        here = path.relative_to(ROOT / top).parts[0].removesuffix(".py")
        if here == "__init__":
            continue
        assert here in level, f"{path}: a room without a place in the house"
        for name in imports(path):
            if name.startswith(f"{top}.") and room(name) != here:
                assert level[room(name)] < level[here], f"{path} imports {name}"


def test_the_pipeline_is_composed_in_one_place():
    """The service and the studies call it; a study may ask for the joint estimate alone."""
    parts = {"fused_estimate", "learn_paths", "learn_chart", "fold_maps", "find_change"}
    parts |= {"moved_within", "moved_beyond_doubt", "chart_result", "by_speeds_alone"}
    alone = {"joint_estimate", "learn_speed_reference", "assumed_speed_reference", "score_groups"}
    for path in sources("service") + sources("studies"):
        kept = parts if "studies" in path.parts else parts | alone
        names = {name.rpartition(".")[2] for name in imports(path) if name.startswith("models.")}
        assert not names & kept, path


def test_only_routes_and_the_application_see_schemas():
    for path in sources("service"):
        api = {name for name in imports(path) if name.startswith("service.api.")}
        if any(not name.startswith("service.api.middleware") for name in api):
            assert {"api", "pages", "app.py"} & set(path.parts), path
        if "middleware" in path.parts:
            assert all(name.startswith("service.api.middleware") for name in api), path


def test_only_one_module_knows_the_engine_outside_the_worker():
    for path in sources("service"):
        if any(name.split(".")[0] == "dbos" for name in imports(path)):
            assert path.name in ("job_queue.py", "engine.py"), path


def test_torch_stays_in_its_rooms():
    for top in ("models", "service"):
        for path in sources(top):
            if any(name.split(".")[0] == "torch" for name in imports(path)):
                place = str(path.relative_to(ROOT))
                assert any(place.startswith(allowed) for allowed in TORCH_ROOMS), place


# Readers for which what they read is a program. What a crash may do to the compiler's own cache is
# read by `code_files` against its hash.
_PROGRAM_READERS = {"pickle", "marshal", "shelve", "dill", "joblib", "cloudpickle", "runpy"}
# PyYAML's loaders make objects. Only its nodes are used, which are text.
_PLAIN_YAML = {"yaml.compose", "yaml.safe_dump", "yaml.parse"}
_PROGRAM_CALLS = {"eval", "exec", "__import__", "torch.load", "np.load", "import_module"}


def test_nothing_that_is_shipped_reads_programs_out_of_data():
    for path in (path for top in ("surefoot", "models", "service") for path in sources(top)):
        if path.name == "code_files.py":
            continue
        assert not {name.split(".")[0] for name in imports(path)} & _PROGRAM_READERS, path
        calls = {
            ast.unparse(node.func)
            for node in ast.walk(ast.parse(path.read_text()))
            if isinstance(node, ast.Call)
        }
        assert not calls & _PROGRAM_CALLS, path
        assert {call for call in calls if call.startswith("yaml.")} <= _PLAIN_YAML, path
        assert not {name for name in imports(path) if name.startswith("yaml.")}, path


@pytest.mark.parametrize("top", ["models", "service"])
def test_no_way_through_the_folders_comes_back(top):
    """What goes down through folders, a post of tracks to its webhook, enters none of them twice.

    A file at the top is a place of its own, and so are a room's thresholds, which import nothing.
    """

    def place(path: Path) -> Path:
        alone = path.parent == ROOT / top or path.name == "config.py"
        return path if alone else path.parent

    places = {
        ".".join(path.relative_to(ROOT).with_suffix("").parts): place(path)
        for path in sources(top)
        if path.name != "__init__.py"
    }
    ways: dict[Path, set[Path]] = {}
    for path in sources(top):
        if path.name != "__init__.py":
            here = place(path)
            there = {places[name] for name in imports(path) if name in places}
            ways.setdefault(here, set()).update(there - {here})
    list(TopologicalSorter(ways).static_order())  # raises on a circle, and names it


def test_the_http_process_imports_no_torch():
    program = (
        "import sys; import service.commands.serve, service.app; "
        "import service.workers.processes.local_workers; "
        "print(sorted({'torch', 'cv2', 'matplotlib', 'scipy', 'numba'} & set(sys.modules)))"
    )
    output = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True, cwd=ROOT
    )
    assert output.stdout.strip() == "[]"
