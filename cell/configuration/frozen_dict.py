"""A dictionary that does not change, for frozen dataclasses."""

from __future__ import annotations

from typing import Any, NoReturn


class FrozenDict[Key, Value](dict[Key, Value]):
    """A dictionary that cannot be changed, can be hashed, and copies and pickles as it is.

    A `MappingProxyType` can be neither hashed nor copied deeply, which `dataclasses.asdict` does.
    """

    def __hash__(self) -> int:
        return hash(frozenset(self.items()))

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (dict(self),)

    def _refuse(self, *_: Any, **__: Any) -> NoReturn:
        raise TypeError(f"A {type(self).__name__} cannot be changed.")

    __setitem__ = __delitem__ = __ior__ = _refuse
    clear = pop = popitem = setdefault = update = _refuse  # type: ignore[assignment]
