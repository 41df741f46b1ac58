"""One process compiles, others wait: until the claim is given back, its owner ends, or patience does."""

from __future__ import annotations

import threading
from pathlib import Path

from aobake.tracing.claims import claimed
from tests.support import python


def test_a_claim_is_waited_for_until_it_is_given_back(tmp_path: Path) -> None:
    file, asked, had = tmp_path / "made", threading.Event(), threading.Event()
    first = claimed(file)

    def second() -> None:
        asked.set()
        claim = claimed(file)
        had.set()
        claim.give_back()

    other = threading.Thread(target=second)
    other.start()
    assert asked.wait(60)
    assert not had.wait(0.2)
    first.give_back()
    first.give_back()
    assert had.wait(60)
    other.join(60)
    assert list(tmp_path.iterdir()) == []


def test_a_process_that_ends_has_no_claim_any_more(tmp_path: Path) -> None:
    file = tmp_path / "made"
    code = "from pathlib import Path; from aobake.tracing.claims import claimed; import os\n"
    done = python("-c", f"{code}held = claimed(Path({str(file)!r})); os._exit(0)")
    assert done.returncode == 0, done.stderr
    assert file.with_suffix(".claim").exists()
    claimed(file).give_back()
    assert list(tmp_path.iterdir()) == []


def test_patience_ends_with_a_claim_in_name_only(tmp_path: Path) -> None:
    held = claimed(tmp_path / "made")
    claimed(tmp_path / "made", patience_s=0.0).give_back()
    assert (tmp_path / "made.claim").exists()
    held.give_back()


def test_where_nothing_can_be_locked_everybody_goes_on(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    claimed(tmp_path / "file" / "made").give_back()
