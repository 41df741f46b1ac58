"""Errors: one tree, messages that name the nearest known thing."""

from __future__ import annotations

import pytest

import aobake
from aobake import errors
from aobake.errors import AobakeError, nearest


def test_every_error_is_an_aobake_error() -> None:
    raised = [getattr(errors, name) for name in errors.__all__ if name[0].isupper()]
    assert len(raised) > 4
    assert all(issubclass(kind, AobakeError) for kind in raised)


@pytest.mark.parametrize(
    ("kind", "builtin"),
    [
        (aobake.SettingsError, ValueError),
        (aobake.InputError, ValueError),
        (aobake.EngineError, RuntimeError),
    ],
)
def test_errors_are_caught_as_the_builtin_ones_that_callers_expect(
    kind: type[AobakeError], builtin: type[Exception]
) -> None:
    assert issubclass(kind, builtin)


def test_a_near_miss_is_answered_with_the_known_name() -> None:
    assert nearest("rayz", ["seed", "rays"]) == ' Did you mean "rays"?'


def test_a_far_miss_is_answered_with_all_known_names_in_order() -> None:
    assert nearest("zzz", ["seed", "rays"]) == " Known: rays, seed."


def test_anything_can_be_looked_up() -> None:
    assert nearest(None, ["a"]) == " Known: a."
