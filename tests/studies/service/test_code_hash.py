"""The hash of code changes with what makes a figure, and with nothing else."""

import pytest

from studies.code_hash import code_hash

pytestmark = pytest.mark.slow


@pytest.fixture
def write(tmp_path):
    def written(place, text):
        path = tmp_path / place
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
        return tmp_path

    written("models/__init__.py", "")
    written("studies/__init__.py", "")
    written("studies/study.py", "from models import used\n")
    written("models/used.py", "from models.deeper import size\n")
    written("models/deeper.py", '"""Words."""\nsize = 3\n')
    return written


def hashed(write, place, text, modules):
    root = write(place, text)
    code_hash.__globals__["_hash"].cache_clear()
    return code_hash(modules, root=root)


@pytest.mark.parametrize("modules", [(), ("models.used",), ("studies.study",)])
def test_it_changes_with_code_that_is_reached_and_not_with_words(write, modules):
    begun = hashed(write, "models/deeper.py", '"""Words."""\nsize = 3\n', modules)
    assert hashed(write, "models/deeper.py", "# other words\nsize  =  3\n", modules) == begun
    assert hashed(write, "studies/study.py", "import models.used\n", modules) == begun
    assert hashed(write, "models/deeper.py", "size = 4\n", modules) != begun


def test_what_is_not_imported_changes_the_whole_hash_alone(write):
    parts = hashed(write, "models/aside.py", "a = 1\n", ("models.used",))
    whole = hashed(write, "models/aside.py", "a = 1\n", ())
    assert hashed(write, "models/aside.py", "a = 2\n", ("models.used",)) == parts
    assert hashed(write, "models/aside.py", "a = 2\n", ()) != whole


def test_figures_of_a_regressor_outlive_a_change_of_the_service():
    from studies.paper.part import SERVED_BY, TRAINED

    assert len({code_hash(), code_hash(TRAINED), code_hash(SERVED_BY)}) == 3
    assert code_hash(TRAINED) == code_hash(tuple(reversed(TRAINED)))
