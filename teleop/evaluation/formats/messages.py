"""Build tables from messages of ROS bags and MCAP files: each number in a message is a column."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from teleop.errors import InputError
from teleop.evaluation.formats.arrays import heading
from teleop.evaluation.formats.columns import Wanted
from teleop.evaluation.formats.table import Heading, Pick, Places, Table

if TYPE_CHECKING:
    from estimation.arrays import Floats

SI_FIELDS = {
    r"(^|\.)force\.[xyz]$": "N",
    r"(^|\.)torque\.[xyz]$": "N m",
    r"(^|\.)(position|translation|point)\.[xyz]$": "m",
}
"""SI units of the fields of ROS messages (REP 103), by a pattern of the field's name."""
LONGEST_LIST = 64
"""Largest number of elements of a list for which each element becomes a column."""
SECONDS = ("sec", "secs")
NANOSECONDS = ("nanosec", "nsec", "nsecs")

FieldPath = tuple[str | int, ...]
"""Path to a value in a message: names of nested fields and indices of list elements, such as
`("force", "z")` or `("position", 0)`."""
Message = tuple[str, int, Callable[[], Any]]
"""Topic of a message, time at which it was recorded [ns], and a function that decodes it."""


@dataclass
class Topic:
    """One topic of a file: the fields of its messages, and the values that were read from them."""

    name: str
    fields: list[FieldPath]
    """Path of each number in a message, without the header of the message."""
    stamp: FieldPath | None
    """Path of the time of measurement; None to use the time at which a message was recorded."""
    wanted: dict[int, FieldPath] = field(default_factory=dict)
    """Path of the number for each column to load, by the index of the column in the table."""
    times: list[int] = field(default_factory=list)
    """Time of each message [ns]."""
    values: list[list[float]] = field(default_factory=list)
    """Values of each message, in the order of `wanted`."""


def tables_of(
    path: Path,
    topics: Sequence[str],
    messages: Callable[[Sequence[str]], Iterator[Message]],
    pick: Pick,
    wanted: Wanted,
) -> list[Table]:
    """Build a table with a column for each number in the messages.

    The columns are named `/topic.field`, or `field` if there is only one topic. The time of a ROS
    message is the time stamp in its header. Without a stamp, and for JSON, it is the time at which
    the message was recorded. If the wanted columns come from several topics, the table has the
    times of the topic with the most messages. The columns of the other topics are interpolated at
    these times.
    """
    if wanted.topic is not None:
        if wanted.topic not in topics:
            names = ", ".join(repr(name) for name in topics[:24]) or "none"
            raise InputError(f"{path}: no topic {wanted.topic!r}: expected one of {names}")
        topics = [wanted.topic]
    found = [topic for topic in first_messages(path, topics, messages) if topic.fields]
    headings = [Heading("time", "s")]
    columns: dict[int, tuple[Topic, FieldPath]] = {}
    for topic in found:
        for place in topic.fields:
            name = written(place)
            unit = next((u for pattern, u in SI_FIELDS.items() if re.search(pattern, name)), None)
            prefix = f"{topic.name}." if len(found) > 1 else ""
            columns[len(headings)] = topic, place
            headings.append(heading(prefix + name, unit))
    picked = sorted(set(pick(headings)) - {0})
    for i in picked:
        topic, place = columns[i]
        topic.wanted[i] = place
    used = [topic for topic in found if topic.wanted]
    if not used:
        return [Table(str(path), headings, {}, 0, str)] if found else []
    collect(path, used, messages)
    return [joined(path, headings, used)]


def first_messages(
    path: Path, topics: Sequence[str], messages: Callable[[Sequence[str]], Iterator[Message]]
) -> list[Topic]:
    """Return the topics that have messages, each with the fields of its first message."""
    found: dict[str, Topic] = {}
    for name, _, decode in messages(topics):
        if name not in found:
            message = decoded(f"{path}, first message of {name}", decode)
            leaves = list(fields_of(message, ()))
            stamp = next((place[:-1] for place in leaves if place[-2:] == ("stamp", "sec")), None)
            numbers = [place for place in leaves if "stamp" not in place and "header" not in place]
            found[name] = Topic(name, numbers, stamp)
            if len(found) == len(topics):
                break
    return [found[name] for name in topics if name in found]


def fields_of(value: Any, place: FieldPath) -> Iterator[FieldPath]:
    """Yield the path of each number in a message.

    A path contains the names of nested fields and the indices of list elements, for example
    `("force", "z")`. Lists with more than `LONGEST_LIST` elements are left out.
    """
    if isinstance(value, (bool, int, float, np.number)):
        yield place
    elif place[-1:] in (("stamp",), ("time",)) and seconds_of(value) is not None:
        yield (*place, "sec")
    elif isinstance(value, dict):
        for name, item in value.items():
            yield from fields_of(item, (*place, str(name)))
    elif isinstance(value, (list, tuple, np.ndarray)):
        if len(value) <= LONGEST_LIST:
            for i, item in enumerate(value):
                yield from fields_of(item, (*place, i))
    else:
        for name in names_of(value):
            yield from fields_of(getattr(value, name), (*place, name))


def names_of(value: Any) -> Sequence[str]:
    """Return the names of the fields of a message, without names that begin with `_`."""
    names: Iterable[str] = getattr(value, "__dataclass_fields__", getattr(value, "__slots__", ()))
    return [name for name in names if not name.startswith("_")]


def seconds_of(value: Any) -> int | None:
    """Convert a ROS time stamp (two integers) to [ns]; None if the value is not a time stamp."""
    parts = []
    item = value.get if isinstance(value, dict) else partial(getattr, value)
    for names in (SECONDS, NANOSECONDS):
        found = (item(name, None) for name in names)
        part = next((one for one in found if isinstance(one, (int, np.integer))), None)
        if part is None:
            return None
        parts.append(int(part))
    return parts[0] * 10**9 + parts[1]


def part_of(message: Any, place: FieldPath) -> Any:
    """Return the part of a message at a path, for example the number at `("force", "z")`."""
    for step in place:
        if isinstance(step, int) or isinstance(message, dict):
            message = message[step]
        else:
            message = getattr(message, step)
    return message


def written(place: FieldPath) -> str:
    """Convert a path in a message to text, for example `("position", 0)` to `position[0]`."""
    text = "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in place)
    return text.removeprefix(".")


def decoded(where: str, decode: Callable[[], Any]) -> Any:
    """Call `decode`, which decodes one message, and return the decoded message.

    The parameter `where` states the file and the message, for the error message.
    """
    try:
        return decode()
    except Exception as error:  # decoders raise errors of any kind for damaged content
        why = " ".join(str(error).split())
        raise InputError(f"{where}: cannot be decoded: {why}") from error


def collect(
    path: Path, used: Sequence[Topic], messages: Callable[[Sequence[str]], Iterator[Message]]
) -> None:
    """Read all messages, and store their times and the wanted numbers in the topics.

    The topics in `used` have wanted fields (`Topic.wanted`). The function extends the lists `times`
    and `values` of these topics. The function `messages` takes the names of topics, and yields the
    messages of these topics.
    """
    topics = {topic.name: topic for topic in used}
    for name, recorded, decode in messages(list(topics)):
        topic = topics[name]
        where = f"{path}, message {len(topic.times) + 1} of {name}"
        message = decoded(where, decode)
        try:
            stamp = seconds_of(part_of(message, topic.stamp)) if topic.stamp else 0
            if stamp is None:
                raise TypeError(topic.stamp)
            row = [float(part_of(message, place)) for place in topic.wanted.values()]
        except (AttributeError, IndexError, KeyError, TypeError, ValueError) as error:
            places = ", ".join(map(written, topic.wanted.values()))
            raise InputError(f"{where}: expected {places} as in the first message") from error
        topic.times.append(stamp or recorded)
        topic.values.append(row)


def joined(path: Path, headings: Sequence[Heading], used: Sequence[Topic]) -> Table:
    """Build one table from the values of several topics.

    The table has the times of the topic with the most messages. The values of the other topics are
    interpolated at these times. Times at which one of the topics has no values are left out.
    """
    start = min(min(topic.times) for topic in used)
    base = max(used, key=lambda topic: len(topic.times))
    t = seconds(base, start)
    others = [topic for topic in used if topic is not base]
    first = max([t[0], *(seconds(topic, start)[0] for topic in others)])
    last = min([t[-1], *(seconds(topic, start)[-1] for topic in others)])
    within = np.flatnonzero((t >= first) & (t <= last)) if others else np.arange(len(t))
    columns = {0: t[within]}
    notes = []
    for topic in used:
        values = np.array(topic.values)
        if topic is not base:
            times = seconds(topic, start)
            if (np.diff(times) < 0.0).any():
                raise InputError(f"{path}: the times of {topic.name} decrease")
            notes.append(f"{topic.name} interpolated at the times of {base.name}")
        for i, column in zip(topic.wanted, values.T, strict=True):
            columns[i] = column[within] if topic is base else np.interp(t[within], times, column)
    if len(within) < len(t):
        notes.append(
            f"{len(t) - len(within)} messages of {base.name} are left out: outside of the time "
            "range of another topic"
        )
    return Table(
        str(path),
        headings,
        columns,
        len(within),
        Places(f"{path}, message ", within + 1, f" of {base.name}"),
        notes=tuple(notes),
    )


def seconds(topic: Topic, start: int) -> Floats:
    """Return the times of the messages of a topic [s], relative to the time `start` [ns]."""
    return np.multiply(np.array(topic.times, dtype=np.int64) - start, 1e-9, dtype=np.float64)
