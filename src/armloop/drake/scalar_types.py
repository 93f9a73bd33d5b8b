"""Systems of several scalar types: pydrake's ``TemplateSystem``, told where a template is defined.

Left to itself, pydrake looks for the module in the source of every frame of the stack, three times a template: two
seconds of each start for a dozen of them.
"""

from __future__ import annotations

import inspect
import sys
from collections.abc import Callable, Sequence
from functools import wraps
from typing import Any
from unittest.mock import patch

from pydrake.common import cpp_template
from pydrake.systems.framework import LeafSystem_, SystemScalarConverter
from pydrake.systems.scalar_conversion import TemplateSystem


def scalar_template(
    name: str, module: str, T_list: Sequence[Any] | None = None
) -> Callable[[Callable[[Any], Any]], Any]:
    """Decorator that makes a scalar-convertible system template of a function from T to a ``LeafSystem_[T]``.

    The class's ``_construct`` is called once the ``LeafSystem_`` is there, and finds its arguments by name in
    ``self._given``, from which a clone or a conversion is made anew unless the class has a ``_construct_copy`` of its own.
    Where a ``_converts`` of the class says no of its arguments, there is no conversion to another scalar type.

    Args:
        name: of the template; ends in an underscore.
        module: ``__name__`` of the module that defines it.
        T_list: scalar types; float, AutoDiffXd and Expression if not given. The first is made at once.
    """
    scope = sys.modules[module]

    def decorator(system: Callable[[Any], Any]) -> Any:
        make = TemplateSystem.define(name, T_list and list(T_list), scope=scope)
        template = make(lambda T: _remembering(system(T), LeafSystem_[T]))
        # The templates that pydrake makes inside have no argument for it.
        with patch.object(cpp_template, "_get_module_from_stack", lambda frame=2: scope, create=True):
            template[float]
        return template

    return decorator


def _remembering(system: Any, base: Any) -> Any:
    construct = system._construct
    signature = inspect.signature(construct)

    @wraps(construct)
    def remember(self: Any, *arguments: Any, converter: Any = None, **options: Any) -> None:
        self._given = signature.bind(self, *arguments, **options).arguments
        del self._given["self"]
        if not getattr(system, "_converts", lambda given: True)(self._given):
            converter = SystemScalarConverter()
        base.__init__(self, converter=converter)
        construct(self, *arguments, **options)

    def copy(self: Any, other: Any, converter: Any = None) -> None:
        remember(self, converter=converter, **other._given)

    # where `help` and an editor look for the arguments
    kept = [p for name, p in signature.parameters.items() if name != "self"]
    system.__signature__ = signature.replace(parameters=kept)
    system._construct = remember
    if "_construct_copy" not in vars(system):
        system._construct_copy = copy
    return system
