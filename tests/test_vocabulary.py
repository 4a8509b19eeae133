"""The field's words: none of those that were left behind is in README, docs, help, messages and public names.

`python tests/test_vocabulary.py` prints what is left, with its place.
"""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from click.testing import CliRunner

from pushplan.cli.main import COMMANDS, MORE, pushplan

ROOT = Path(__file__).parents[1]
LEFT_BEHIND = {
    r"bears|bearing on": "tolerates",
    r"errands?|legs|courses?": "task, transfer, measured push",
    r"way pushed|free words?": "pushed distance, collision-free steering path",
    r"several pushes|several objects": "multi-push plan, rearrangement",
    r"settled|wanted": "what it is",
    r"verdicts?|flaws?|troubles?|faults?|doubts?|judges?": "validator, validation result, error, warning, reason",
    r"findings?": "error",
    r"least possible": "optimality gap",
    r"auto in ecof": "planner auto, stable set ecof",
    r"kick(s|ed)?": "disturbance",
    r"worlds|misjudged": "Monte Carlo samples, model error",
    r"off its place|leans?": "pose error, load-distribution shift",
    r"soonest|anew": "fastest, recomputed",
    r"cut_off|plan_again": "incomplete, replan",
}
"""What was said, and what is said."""

ALLOWED = (
    r"without (finding|a path)|from finding|root finding",
    r"`?findings`?\)|errors Finding|\.findings",  # of `ScenarioError`: a fixed public name
)


def words_left(text: str) -> list[str]:
    """Return the words of a text that were left behind, with what is around them."""
    found = []
    for pattern in LEFT_BEHIND:
        for match in re.finditer(
            rf"(?<![\w/.`#-])({pattern})(?![\w/`.-]*\.(md|yaml|png))\b", text, re.IGNORECASE
        ):
            around = text[max(0, match.start() - 40) : match.end() + 40].replace("\n", " ")
            if not any(re.search(one, around, re.IGNORECASE) for one in ALLOWED):
                found.append(around)
    return found


def pages() -> Iterator[tuple[str, str]]:
    for page in (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))):
        yield page.name, page.read_text("utf-8")


def helps() -> Iterator[tuple[str, str]]:
    for words in ([], *([name] for name in COMMANDS | MORE)):
        yield (
            " ".join(["pushplan", *words, "--help"]),
            CliRunner().invoke(pushplan, [*words, "--help"]).output,
        )


def messages() -> Iterator[tuple[str, str]]:
    """Yield the texts of the package that are sentences or parts of them, without docstrings."""
    for folder in ("pushplan", "planners", "sim", "logging"):
        for file in sorted((ROOT / folder).rglob("*.py")):
            if file.is_symlink() or any(part.is_symlink() for part in file.parents):
                continue
            tree = ast.parse(file.read_text("utf-8"))
            bare = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
            for node in ast.walk(tree):
                text = node.value if isinstance(node, ast.Constant) and id(node) not in bare else None
                if isinstance(text, str) and " " in text.strip():
                    yield f"{file.relative_to(ROOT)}:{getattr(node, 'lineno', 0)}", text


def public_names() -> Iterator[tuple[str, str]]:
    reference = (ROOT / "docs" / "api.md").read_text("utf-8")
    for name in re.findall(r"^ +pushplan\.([\w.]+)$", reference, re.MULTILINE):
        spaced = re.sub(r"(?<=[a-z])(?=[A-Z])|[._]", " ", name)
        yield name, spaced


SOURCES = {"pages": pages, "help": helps, "messages": messages, "public names": public_names}


def left(source: str) -> list[str]:
    return [f"{place}: {words}" for place, text in SOURCES[source]() for words in words_left(text)]


@pytest.mark.parametrize("source", SOURCES)
def test_no_word_that_was_left_behind_is_there(source: str) -> None:
    assert left(source) == []


@pytest.mark.parametrize(
    "text", ["it bears 3 mm", "three kicks", "in 40 worlds", "the verdict is", "a plan of several pushes"]
)
def test_a_word_that_was_left_behind_is_found(text: str) -> None:
    assert len(words_left(text)) == 1


if __name__ == "__main__":
    for name in SOURCES:
        for line in left(name):
            print(line)
