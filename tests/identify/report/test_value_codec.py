"""Dataclasses to JSON and back without a bit changed, and refusals of what does not fit."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
import pytest

from identify.report.value_codec import Arrays, CodecError, decode, encode
from identify.results import Identification
from rig.recording.run import Array
from tests.identify.sample import sample, unhappy


@dataclass(frozen=True)
class Inner:
    value: float | None
    kind: Literal["a", "b"] = "a"


@dataclass(frozen=True)
class Outer:
    name: str
    count: int
    is_good: bool
    pair: tuple[str, float]
    several: tuple[Inner, ...]
    by_name: Mapping[str, Inner]
    by_order: Mapping[int, float]
    trace: Array | None
    anything: Mapping[str, Any] = field(default_factory=dict)


WHOLE = Outer(
    "x", 3, True, ("y", 0.1), (Inner(1.5), Inner(None, "b")), {"k": Inner(-0.0)}, {2: 0.5}, np.array([0.1, np.nan]),
    {"sets": [{"kind": "sine", "torque_nm": 1}]},
)  # fmt: skip


def there_and_back(value: Any) -> Any:
    arrays = Arrays()
    text = json.dumps(encode(value, arrays))
    return decode(type(value), json.loads(text), arrays.kept)


def same(a: Any, b: Any) -> bool:
    """Equal in every bit: types, NaN and the sign of zero included."""
    if isinstance(a, np.ndarray):
        return isinstance(b, np.ndarray) and a.dtype == b.dtype and a.tobytes() == b.tobytes()
    if hasattr(a, "__dataclass_fields__"):
        return type(a) is type(b) and all(same(getattr(a, n), getattr(b, n)) for n in a.__dataclass_fields__)
    if isinstance(a, Mapping):
        return list(a) == list(b) and all(same(a[k], b[k]) for k in a)
    if isinstance(a, tuple):
        return isinstance(b, tuple) and len(a) == len(b) and all(map(same, a, b))
    if isinstance(a, float):
        return repr(float(a)) == repr(float(b)) and math.copysign(1, a) == math.copysign(1, b)
    return bool(a == b)


@pytest.mark.parametrize("value", [WHOLE, Inner(math.nan), Inner(-math.inf), Inner(1e-320), Inner(0.1 + 0.2)])
def test_a_value_comes_back_with_every_bit(value: Any) -> None:
    assert same(value, there_and_back(value))


def test_numbers_of_numpy_come_back_as_plain_ones() -> None:
    back = there_and_back(Inner(np.float64(0.1)))
    assert back == Inner(0.1)
    assert type(back.value) is float
    back = there_and_back(replace(WHOLE, count=np.int64(3), is_good=np.True_))
    assert same(back, replace(WHOLE, is_good=True))


@pytest.mark.parametrize("made", [lambda: sample(2.0)[0], unhappy], ids=["accepted", "unhappy"])
def test_a_whole_identification_comes_back_with_every_bit(made: Callable[[], Identification]) -> None:
    found = made()
    assert same(found, there_and_back(found))


def test_an_array_that_stands_in_two_places_is_kept_once() -> None:
    arrays = Arrays()
    numbers = np.arange(5.0)
    assert [encode(a, arrays)["array"] for a in (numbers, numbers.copy(), numbers + 1.0)] == [0, 0, 1]
    assert len(arrays.kept) == 2


def test_what_is_no_plain_value_is_refused() -> None:
    with pytest.raises(TypeError, match="object is no plain value"):
        encode({"a": object()}, Arrays())


WRONG = {
    "a text for a number": ({"count": "3"}, "Outer.count is '3'"),
    "true for a number": ({"count": True}, "Outer.count is True"),
    "a number for true": ({"is_good": 1}, "Outer.is_good is 1"),
    "a word that is not allowed": ({"several": [{"value": 1.0, "kind": "c"}]}, "Outer.several.0.kind is 'c'"),
    "a pair of three": ({"pair": ["y", 0.1, 2]}, "Outer.pair"),
    "a list for a mapping": ({"by_name": []}, "Outer.by_name is []"),
    "a key that is no number": ({"by_order": {"two": 0.5}}, "Outer.by_order: 'two' is no int"),
    "an array that is not there": ({"trace": {"array": 7}}, "Outer.trace"),
    "a list for a dataclass": ({"several": [[]]}, "Outer.several.0 is []"),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_does_not_fit_its_field_is_refused_with_its_path(case: str) -> None:
    changes, message = WRONG[case]
    arrays = Arrays()
    content = encode(WHOLE, arrays) | changes
    with pytest.raises(CodecError) as refused:
        decode(Outer, content, arrays.kept)
    assert message in str(refused.value)


def test_a_field_of_a_later_version_is_passed_over_and_one_that_is_missing_is_said() -> None:
    arrays = Arrays()
    content = encode(WHOLE, arrays) | {"of_tomorrow": 1}
    assert same(decode(Outer, content, arrays.kept), WHOLE)
    del content["pair"]
    with pytest.raises(CodecError, match=r"Outer\.pair is missing"):
        decode(Outer, content, arrays.kept)
