"""Check array shapes against annotations in every call of the numerical rooms' public functions during tests.

Other types are checked by mypy. `install` must be called before the package is imported.
"""

import inspect
import sys
from collections.abc import Callable, Sequence
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder
from types import ModuleType
from typing import Any

from beartype import beartype
from jaxtyping import jaxtyped

ROOMS = ("fit", "hand", "movement", "paper", "scores")


def checked(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return the function with its annotated array shapes, and nothing else, checked in every call."""
    shaped = {name: hint for name, hint in function.__annotations__.items() if "Float[" in hint}
    if not shaped:
        return function
    function.__annotations__ = shaped
    wrapped: Callable[..., Any] = jaxtyped(typechecker=beartype)(function)
    return wrapped


class ShapeChecks(MetaPathFinder):
    """Finder that wraps the public functions of the numerical rooms' modules when they are imported."""

    def find_spec(
        self, name: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Return the spec of a numerical module with checks, or None for other modules."""
        spec = PathFinder.find_spec(name, path, target) if name.startswith("shukotsu.") else None
        if spec is None or spec.loader is None or name.split(".")[1] not in ROOMS:
            return None
        execute = spec.loader.exec_module

        def execute_and_wrap(module: ModuleType) -> None:
            execute(module)
            for own, function in inspect.getmembers(module, inspect.isfunction):
                if function.__module__ == name and not own.startswith("_"):
                    setattr(module, own, checked(function))

        spec.loader.exec_module = execute_and_wrap  # type: ignore[method-assign]
        return spec


def install() -> None:
    """Check shapes in all modules imported from now on."""
    sys.meta_path.insert(0, ShapeChecks())
