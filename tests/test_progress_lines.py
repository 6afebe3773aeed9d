"""Long commands say on stderr how far they are where no terminal shows a bar."""

import re
import time

import pytest

from oarlock.cli.terminal import progress
from oarlock.storage import progress as shared
from oarlock.storage.progress import progress_words

HANGS_S = 60.0


def until(said, pattern, capsys):
    """Waits for a line on stderr, however busy the machine is."""
    ends_s = time.monotonic() + HANGS_S
    while not re.search(pattern, said[0]) and time.monotonic() < ends_s:
        time.sleep(0.005)
        said[0] += capsys.readouterr().err
    assert re.search(pattern, said[0]), said[0]


def test_lines_come_again_and_again_with_the_share_that_is_done(capsys, monkeypatch):
    monkeypatch.setattr(shared, "FIRST_LINE_S", 0.01)
    monkeypatch.setattr(shared, "LINES_S", 0.01)
    said = [""]
    with progress("tracking") as told:
        until(said, r"^tracking: \d+ s\n", capsys)
        told(0.124)
        until(said, r"\ntracking: 12 %, \d+ s\n", capsys)
        told(0.5)
        until(said, r"\ntracking: 50 %, \d+ s\n", capsys)
    capsys.readouterr()
    time.sleep(0.05)
    done = capsys.readouterr()
    assert not done.err and not done.out


def test_a_quick_command_prints_none(capsys):
    with progress("tracking") as told:
        told(0.5)
    assert not capsys.readouterr().err


def test_the_first_line_comes_after_seconds_and_the_others_less_often():
    assert (shared.FIRST_LINE_S, shared.LINES_S) == (5.0, 10.0)


def test_lines_end_with_what_they_are_about(capsys, monkeypatch):
    monkeypatch.setattr(shared, "FIRST_LINE_S", 0.01)
    said = [""]
    with pytest.raises(ValueError, match="no samples"), progress("smoothing"):
        until(said, "smoothing: ", capsys)
        raise ValueError("no samples")
    assert said[0].count("smoothing") == 1


@pytest.mark.parametrize(
    ("share", "elapsed_s", "words"),
    [
        (0.0, 600.0, "600 s"),
        (0.124, 30.0, "12 %, 30 s"),
        (0.25, 100.0, "25 %, 100 s, about 5 min left"),
        (1.0, 100.0, "100 %, 100 s"),
    ],
)
def test_after_a_minute_they_say_what_is_left(share, elapsed_s, words):
    assert progress_words(share, elapsed_s) == words
