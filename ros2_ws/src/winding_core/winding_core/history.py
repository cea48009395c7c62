"""A bounded history: the newest items whole, older ones thinned evenly."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import TypeVar, overload

Item = TypeVar("Item")


class History(Sequence[Item]):
    """Keeps the newest items and an even sample of those before them.

    A full sample drops every second item and doubles its stride, so a run of any length is
    covered from its start. Without a sample the oldest items go. One thread appends; others may
    read meanwhile.
    """

    def __init__(
        self, *, newest: int, older: int = 0, merge: Callable[[Item, Item], Item] | None = None
    ) -> None:
        """Start empty.

        Args:
            newest: So many of the newest items are kept whole; up to twice as many are held.
            older: Most items of the sample before them.
            merge: Returns a later item with what it takes over from its neighbour before it,
                which is dropped from the sample; None takes over nothing.
        """
        if min(newest, older) < 0 or newest + older < 1:
            raise ValueError(f"a history needs room for items, got {newest} and {older}")
        self.taken = 0  # Items that ever came
        self.stride = 1  # Of the sample; 1 while nothing has been dropped from it
        self._room = (newest, older)
        self._merge = merge
        self._dropped: Item | None = None
        self._parts: tuple[list[Item], list[Item]] = ([], [])

    def append(self, item: Item) -> None:
        """Take an item."""
        _, newest = self._parts
        newest.append(item)
        self.taken += 1
        if len(newest) >= 2 * self._room[0]:
            self._thin()

    def rewound(self, items: Iterable[Item]) -> History[Item]:
        """Return a history with as much room that holds these of its items and counts on."""
        history = self._empty()
        kept = list(items)
        history.taken = self.taken - len(kept)
        for item in kept:
            history.append(item)
        return history

    def only(self, keep: Callable[[Item], bool]) -> History[Item]:
        """Return an independent history with those items of this one that are to be kept."""
        history = self._empty()
        older, newest = self._parts
        history._parts = ([*filter(keep, older)], [*filter(keep, newest)])
        history.taken, history.stride = self.taken - len(self) + len(history), self.stride
        return history

    def newest(self, count: int) -> list[Item]:
        """Return so many of the newest items, or those of them that are kept whole."""
        _, newest = self._parts
        return newest[max(len(newest) - count, 0) :]

    def __len__(self) -> int:
        return sum(map(len, self._parts))

    def __iter__(self) -> Iterator[Item]:
        older, newest = self._parts
        return iter([*older, *newest])

    def __reversed__(self) -> Iterator[Item]:
        older, newest = self._parts
        return reversed([*older, *newest])

    @overload
    def __getitem__(self, index: int) -> Item: ...

    @overload
    def __getitem__(self, index: slice) -> list[Item]: ...

    def __getitem__(self, index: int | slice) -> Item | list[Item]:
        older, newest = self._parts
        if isinstance(index, slice):
            return [*older, *newest][index]
        if -len(newest) <= index < 0:
            return newest[index]
        return older[index + len(newest)] if index < 0 else [*older, *newest][index]

    def _empty(self) -> History[Item]:
        newest, older = self._room
        return History(newest=newest, older=older, merge=self._merge)

    def _thin(self) -> None:
        whole, most = self._room
        older, newest = self._parts
        count = len(newest) - whole
        kept = [*older, *self._sampled(newest[:count])] if most else []
        while len(kept) > most:
            kept = self._halved(kept)
            self.stride *= 2
        # One assignment: a reader sees the parts of before or those of after.
        self._parts = (kept, newest[count:])

    def _sampled(self, leaving: list[Item]) -> list[Item]:
        """Return those of the items that leave the newest whose number is a multiple of stride."""
        first = self.taken - len(self._parts[1])
        if self._merge is None:
            return leaving[-first % self.stride :: self.stride]
        kept = []
        for number, item in enumerate(leaving, start=first):
            merged = item if self._dropped is None else self._merge(self._dropped, item)
            self._dropped = merged if number % self.stride else None
            if self._dropped is None:
                kept.append(merged)
        return kept

    def _halved(self, kept: list[Item]) -> list[Item]:
        if self._merge is None:
            return kept[::2]
        return [kept[0], *map(self._merge, kept[1::2], kept[2::2])]
