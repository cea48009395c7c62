"""What came on one topic, in bounded memory: the newest all there, older ones thinned evenly."""

from __future__ import annotations

from array import array
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import TypeVar, overload

import numpy as np
from numpy.typing import NDArray

Item = TypeVar("Item")


class ThinnedHistory(Sequence[Item]):
    """Keeps the newest items and an even sample of those before them.

    A full sample drops every second item and doubles its stride, so a run of any length is
    covered from its start. One thread appends; others may read meanwhile.

    Attributes:
        taken: Items that ever came.
        stride: Of the sample; 1 while nothing has been dropped.
    """

    def __init__(self, *, whole: int, sample: int) -> None:
        """Start empty.

        Args:
            whole: So many of the newest items are all there.
            sample: Most items before them; twice `whole` and these are the most that is held.
        """
        if whole < 1 or sample < 2:
            raise ValueError(f"a reel needs room for items, got {whole} and {sample}")
        self.taken = 0
        self.stride = 1
        self._whole = whole
        self._sample = sample
        self._parts: tuple[list[Item], list[Item]] = ([], [])

    def append(self, item: Item) -> None:
        """Take an item."""
        _, newest = self._parts
        newest.append(item)
        self.taken += 1
        if len(newest) >= 2 * self._whole:
            self._thin()

    def rewound(self, items: Iterable[Item]) -> ThinnedHistory[Item]:
        """Return a reel with as much room that holds these of its items and counts on."""
        reel: ThinnedHistory[Item] = ThinnedHistory(whole=self._whole, sample=self._sample)
        kept = list(items)
        reel.taken = self.taken - len(kept)
        for item in kept:
            reel.append(item)
        return reel

    def only(self, keep: Callable[[Item], bool]) -> ThinnedHistory[Item]:
        """Return a reel of its own with those items of this one that are to be kept."""
        reel: ThinnedHistory[Item] = ThinnedHistory(whole=self._whole, sample=self._sample)
        older, newest = self._parts
        reel._parts = ([*filter(keep, older)], [*filter(keep, newest)])
        reel.taken, reel.stride = self.taken - len(self) + len(reel), self.stride
        return reel

    def newest(self, count: int) -> list[Item]:
        """Return so many of the newest items, or those of them that are all there."""
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
        if isinstance(index, int) and -len(newest) <= index < 0:
            return newest[index]
        return [*older, *newest][index]

    def _thin(self) -> None:
        older, newest = self._parts
        first = self.taken - len(newest)
        leaving = enumerate(newest[: self._whole], start=first)
        kept = [*older, *(item for k, item in leaving if k % self.stride == 0)]
        while len(kept) > self._sample:
            kept = kept[::2]
            self.stride *= 2
        # One assignment: a reader sees the parts of before or those of after.
        self._parts = (kept, newest[self._whole :])


class StampRuns:
    """Every stamp of a topic, held as runs of equal steps: a steady topic takes no memory.

    Args:
        step_ns: The topic's period [ns].
    """

    def __init__(self, step_ns: int) -> None:
        self._step_ns = step_ns
        self._first, self._last = array("q"), array("q")

    def add(self, stamp_ns: int) -> None:
        """Take a stamp [ns]."""
        if self._last and stamp_ns - self._last[-1] == self._step_ns:
            self._last[-1] = stamp_ns
        else:
            self._first.append(stamp_ns)
            self._last.append(stamp_ns)

    def without_last(self, count: int) -> StampRuns:
        """Return runs of their own of all stamps but so many of the newest."""
        runs = StampRuns(self._step_ns)
        stamps = self.stamps()
        for stamp in stamps[: len(stamps) - count].tolist():
            runs.add(stamp)
        return runs

    def stamps(self) -> NDArray[np.int64]:
        """Return all stamps [ns] in the order they came, shape (n,)."""
        runs = [
            np.arange(first, last + 1, self._step_ns, dtype=np.int64)
            for first, last in zip(self._first, self._last, strict=True)
        ]
        return np.concatenate(runs) if runs else np.zeros(0, dtype=np.int64)
