"""The catalogues are whole: every text has its words, no words are of a text that is gone."""

import ast
import re
from collections import Counter

import pytest
from babel.messages import jslexer
from babel.messages.catalog import Message

from tests.catalogue import FILES, ROOT, extracted, kept

PLACES = re.compile(r"%\(\w+\)s|%%|\{[^}]*\}")
TAGS = re.compile(r"<[^>]+>")
# Two words or more, one after the other.
SENTENCE = re.compile(r"[A-Za-z’']{2,}[,;:]? [a-zA-Z’']{2,}")
MARKS = ("_", "_n", "N_")
# What wording/ says to programs alone.
FOR_PROGRAMS = {"This is a test of surefoot; it ends by itself.", "camera ", " cameras of "}
KEPT = {" instead of "}  # of a note, which is stored as it is
# Strings of scripts that nobody reads: selectors, classes, states.
NO_WORDS = re.compile(
    r"[\[\]#=>]|button, input|textarea|dialog form|under way|(zone|banner|mark) |Bearer "
    r"|state: only"  # of a refusal, as the API says it
)


def texts(message: Message) -> list[tuple[str, str]]:
    """The forms of a message, each beside what it is in the language."""
    if message.pluralizable:
        return list(zip(message.id, message.string, strict=True))
    return [(message.id, message.string)]


@pytest.mark.parametrize("language", FILES)
def test_a_catalogue_has_the_texts_of_the_code_and_where_they_stand(language):
    """`python -m tests.catalogue --write` makes it so; of what is new, words are to be written.

    Pages bring their scripts the words of texts that stand in scripts.
    """
    now = {each.id: {path for path, _ in each.locations} for each in extracted()}
    has = {each.id: {path for path, _ in each.locations} for each in kept(language)}
    assert has.keys() - now.keys() == set()
    assert now.keys() - has.keys() == set()
    assert has == now


@pytest.mark.parametrize("language", FILES)
def test_each_text_has_its_words_with_the_same_places_and_tags(language):
    for message in kept(language):
        for text, said in texts(message) if message.id else []:
            assert said, text
            assert not message.fuzzy, text
            assert sorted(PLACES.findall(said)) == sorted(PLACES.findall(text)), text
            assert Counter(TAGS.findall(said)) == Counter(TAGS.findall(text)), text
            assert (said[0] == " ", said[-1] == " ") == (text[0] == " ", text[-1] == " "), text
            assert '"' not in TAGS.sub("", said), f"{text}: it may stand in an attribute"


def unmarked(source: str) -> set[str]:
    """The sentences of a module that are neither docs nor marked."""
    tree = ast.parse(source)
    passed = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") in MARKS:
            passed |= {id(part) for arg in node.args for part in ast.walk(arg)}
        elif isinstance(node, ast.Expr):
            passed.add(id(node.value))
    return {
        node.value
        for node in ast.walk(tree)
        if isinstance(node, ast.Constant)
        and isinstance(node.value, str)
        and id(node) not in passed
        and (SENTENCE.search(node.value) or re.fullmatch(r" ?[a-z]+ ([a-z]+ )?", node.value))
    }


def test_no_sentence_of_the_wording_stands_unmarked():
    wording = (ROOT / "service" / "wording").glob("*.py")
    found = set().union(*(unmarked(path.read_text()) for path in wording))
    assert found == FOR_PROGRAMS | KEPT
    assert unmarked('def f():\n    "Docs are docs."\n    return _("all is well")') == set()
    assert unmarked('f"{n} are there" + "all is well"') == {" are there", "all is well"}


def unmarked_in_script(source: str, known: set[str]) -> set[str]:
    """The sentences of a script that are no part of a known text."""
    found = set()
    for token in jslexer.tokenize(source):
        if token.type in ("string", "template_string"):
            text = re.sub(r"\$\{[^}]*\}", "", jslexer.unquote_string(token.value))
            if SENTENCE.search(text) and not NO_WORDS.search(text):
                found.add(text)
    return {text for text in found if not any(text in each for each in known)}


def test_no_sentence_of_a_script_stands_unmarked():
    known = {text for message in extracted() for text in message.id and dict(texts(message))}
    for path in (ROOT / "service" / "pages" / "static").glob("*.js"):
        assert unmarked_in_script(path.read_text(), known) == set(), path.name
    assert unmarked_in_script("say(`${n} are there`, 'a', 'all is well')", {"all is well."}) == {
        " are there"
    }


def test_where_texts_are_said_nothing_else_is_called_so():
    """A `_` that takes what nobody wants hides the one that says texts, in its whole function."""
    for path in (ROOT / "service").rglob("*.py"):
        nodes = [*ast.walk(ast.parse(path.read_text()))]
        names = {alias.name for n in nodes if isinstance(n, ast.ImportFrom) for alias in n.names}
        targets = [t for n in nodes if isinstance(n, ast.Assign) for t in n.targets]
        targets += [n.target for n in nodes if isinstance(n, ast.For)]
        taken = {n.id for t in targets for n in ast.walk(t) if isinstance(n, ast.Name)}
        assert not {"_"} & names & taken, path
    for path in (ROOT / "service" / "pages" / "static").glob("*.js"):
        lines = [line for line in path.read_text().splitlines() if not line.startswith("import")]
        assert not re.findall(r"[(,{] ?_ ?[,)}].*|: _ ?[,}].*", "\n".join(lines)), path
