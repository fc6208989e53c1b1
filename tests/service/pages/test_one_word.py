"""One word for one act, on all buttons, in bars, flags, the history and what scripts say."""

import html
import re

import pytest

from service.enums import Answer
from service.wording.actions import ACTIONS
from tests.service.alerts.test_states import knock
from tests.service.bench import PRIOR, moved
from tests.test_architecture import ROOT

# Words of before for the same acts.
OTHERS = (
    r"\bNoted\b|[Tt]aken back|took the last answer back|[Aa]ccept(?:ed)? the new pose|pose accepted"
    r"|[Ll]earn(?:ed)? it anew|[Ll]earn them anew|[Ss]een by|Called false|never moved[.<]"
    r"|right again|works? again|did not move<|is mended"
)
WORDS = {
    "put_back": "put back",
    "accepted": "new aim",
    "fixed": "fixed",
    "false_alarm": "false alarm",
}


def pages(http):
    paths = ("/", "/ui/alerts?all=true", "/ui/cameras/corner", "/ui/report", "/ui/wall")
    return {path: html.unescape(http.get(path).text) for path in paths}


def buttons(text, attribute, value):
    found = re.findall(rf'<button[^>]*{attribute}="{value}"[^>]*>([^<]*)</button>', text)
    return {each.strip() for each in found}


@pytest.mark.parametrize("answer", list(Answer))
def test_each_answer_has_one_word_wherever_it_stands(bench, answer):
    if answer == Answer.FIXED:
        bench.see(PRIOR)
        for _ in range(3):
            bench.see(moved(height_m=1.32))
    else:
        knock(bench)
    (alert,) = bench.alerts(state="firing")
    bench.http.post(f"/alerts/{alert['id']}/acknowledge", json={"by": "Bo"}).raise_for_status()
    before = pages(bench.http)
    words = ACTIONS[answer]
    for path, text in before.items():
        assert re.findall(OTHERS, text) == [], path
        assert buttons(text, "data-outcome", answer) <= {words.one}, path
        assert buttons(text, "data-takes", answer) <= {words.many}, path
    assert "acknowledged by Bo" in before["/"]
    assert buttons(before["/ui/cameras/corner"], "data-outcome", answer) == {words.one}
    body = {"ids": [alert["id"]], "action": "resolve", "outcome": answer, "by": "Ada"}
    told = bench.http.post("/actions", json=body).json()
    assert told["undo"]["ids"] == ["corner"]
    after = pages(bench.http)
    for path in ("/ui/alerts?all=true", "/ui/cameras/corner", "/ui/report"):
        assert re.findall(OTHERS, after[path]) == [], path
        assert WORDS[answer] in after[path].lower(), path


def test_scripts_and_commands_say_no_other():
    for path in [*ROOT.glob("service/pages/static/*.js"), ROOT / "service/commands/remote.py"]:
        code = re.sub(r"(?m)^\s*//.*$", "", path.read_text())
        assert re.findall(OTHERS, code) == [], path
