"""Effects that are switched by hand: what can be said of each, and what it comes to as settings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from aobake.errors import SettingsError, nearest

__all__ = ["EFFECTS", "forced", "switched"]

# What an effect is when it is off, and when it is on: (setting, off, on). An effect that cannot be on without
# being told more has no value for on. Those that are decided from the scene alone have no setting.
_SETTINGS: Mapping[str, tuple[str, object, object]] = {
    "distribution": ("distribution", "cosine", "uniform"),
    "spread": ("spread", 180.0, None),
    "max_distance": ("max_distance", None, None),
    "falloff": ("falloff", "none", None),
    "ground": ("ground", None, None),
    "occluders": ("occluders", ("all",), None),
    "exclude": ("exclude", (), None),
    "backfaces": ("backfaces", "occlude", "ignore"),
    "bent_normals": ("bent_normals", False, True),
    "mean_distance": ("mean_distance", False, True),
    "method": ("method", "point", "lsq"),
    "normal_map": ("normal_map", False, True),
    "blend": ("blend", "replace", "multiply"),
    "denoise": ("denoise", "off", "on"),
}
_TRIED = ("open_sky",)
_FOUND = ("sharing", "alpha")  # a scene has them or has not
EFFECTS = (*_TRIED, *_FOUND, *_SETTINGS)


def forced(given: Sequence[str]) -> dict[str, bool]:
    """Which effects are switched on or off by 'NAME=on' and 'NAME=off'; none by nothing.

    Raises SettingsError for anything else, for a name that is no effect, and for one that is switched both ways.
    """
    found: dict[str, bool] = {}
    for words in given:
        name, _, word = str(words).partition("=")
        if word not in {"on", "off"}:
            raise SettingsError(f"effect is {words!r}; NAME=on or NAME=off is needed.")
        if name not in EFFECTS:
            raise SettingsError(
                f"effect is {words!r}; {name!r} is no effect.{nearest(name, EFFECTS)}"
            )
        if word == "on" and name in _FOUND:
            raise SettingsError(
                f"effect is {words!r}; {name} follows from what is in the scene, and can only be off."
            )
        if found.setdefault(name, word == "on") != (word == "on"):
            raise SettingsError(f"effect {name!r} is switched on and off; say one of the two.")
    return found


def switched(
    given: Sequence[str], values: Mapping[str, object], defaults: Mapping[str, object]
) -> dict[str, object]:
    """The settings that switched effects come to: name -> value, for those that differ from `values`.

    values, defaults : settings as they are, and as they would be if nobody had said anything
    Raises SettingsError where a switch contradicts a setting, or where it leaves out what is needed.
    """
    changed: dict[str, object] = {}
    for name, on in forced(given).items():
        setting, off_value, on_value = _SETTINGS.get(name, ("", None, None))
        if setting not in values:
            continue
        value = values[setting]
        is_default = value == defaults[setting]
        if on == (value != off_value) and value != "auto":
            continue
        if not (is_default or value == "auto"):
            raise SettingsError(
                f"effect {name + ('=on' if on else '=off')!r} contradicts {setting}, which is {value!r}; "
                "leave one of them out."
            )
        if on and on_value is None:
            raise SettingsError(
                f"effect '{name}=on' does not say how; give {setting} a value instead."
            )
        changed[setting] = on_value if on else off_value
    return changed
