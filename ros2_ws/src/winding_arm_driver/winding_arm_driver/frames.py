"""Where a frame stands in another one, by the transforms between them."""

from __future__ import annotations

from winding_core.arm.rigid import Pose

# A chain that is longer leads in a circle.
_MOST_FRAMES = 1000


class FrameTree:
    """Newest transforms from parents to children, as TF publishes them."""

    def __init__(self) -> None:
        self._parents: dict[str, tuple[str, Pose]] = {}

    def add(self, parent: str, child: str, pose: Pose) -> None:
        """Take where a child frame stands in its parent."""
        self._parents[child] = (parent, pose)

    def chain(self, frame: str) -> list[str]:
        """Return a frame and its parents, the root last.

        Raises:
            ValueError: They lead in a circle.
        """
        found = [frame]
        while found[-1] in self._parents:
            found.append(self._parents[found[-1]][0])
            if len(found) > _MOST_FRAMES:
                raise ValueError(f"the parents of frame {frame} lead in a circle")
        return found

    def between(self, base: str, tip: str) -> Pose | None:
        """Return where a tip stands in a base; None where no transforms join them.

        Raises:
            ValueError: Their parents lead in a circle.
        """
        up, down = self.chain(base), self.chain(tip)
        shared = next((frame for frame in up if frame in down), None)
        if shared is None:
            return None
        return self._from(shared, base).inverse() @ self._from(shared, tip)

    def _from(self, ancestor: str, frame: str) -> Pose:
        pose = Pose.standing()
        while frame != ancestor:
            parent, own = self._parents[frame]
            pose, frame = own @ pose, parent
        return pose
