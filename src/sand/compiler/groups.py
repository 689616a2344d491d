"""Groups: NamedTuples of arrays in compiled code, as one pointer per array and a pointer to their lengths.

Numba's own tuples of arrays make functions with hundreds of arguments, which take half as long again to compile.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir  # type: ignore[import-untyped]
from numba import types
from numba.core.datamodel import models
from numba.core.typing.templates import AttributeTemplate
from numba.extending import infer_getattr, lower_getattr_generic, register_model

__all__ = ["WORD", "Group", "array_of", "constant_word"]

WORD = ir.IntType(64)


class Group(types.Type):
    """Type of a NamedTuple of arrays in compiled code: pointers to the arrays, and to the row with their lengths.

    Parameters
    ----------
    fields : tuple
        (name, dtype, number of axes) of each array.
    """

    def __init__(self, fields: tuple[tuple[str, Any, int], ...]):
        self.fields = fields
        super().__init__(name=f"Group({', '.join(f'{name}: {dtype} {axes}' for name, dtype, axes in fields)})")


@register_model(Group)
class _GroupModel(models.StructModel):
    def __init__(self, manager: Any, group: Group):
        pointers = [(name, types.CPointer(dtype)) for name, dtype, _ in group.fields]
        super().__init__(manager, group, [*pointers, ("row", types.CPointer(types.int64))])


@infer_getattr
class _GroupAttribute(AttributeTemplate):
    key = Group

    def generic_resolve(self, group: Group, name: str) -> Any:
        """The type of one array."""
        return next((types.Array(dtype, axes, "C") for n, dtype, axes in group.fields if n == name), None)


@lower_getattr_generic(Group)
def _array_of_group(context: Any, builder: Any, group: Group, value: Any, name: str) -> Any:
    number = [n for n, _, _ in group.fields].index(name)
    _, dtype, axes = group.fields[number]
    first = len(group.fields) + sum(axes for _, _, axes in group.fields[:number])
    row = builder.extract_value(value, len(group.fields))
    shape = [constant_word(builder, row, first + axis) for axis in range(axes)]
    return array_of(context, builder, dtype, builder.extract_value(value, number), shape)


def constant_word(builder: Any, row: Any, index: int) -> Any:
    """A word of a row, which does not change during a call of a stage, so that loops need not read it again."""
    word = builder.load(builder.gep(row, [ir.Constant(WORD, index)]))
    word.set_metadata("invariant.load", builder.module.add_metadata([]))
    return word


def array_of(context: Any, builder: Any, dtype: Any, data: Any, shape: list[Any]) -> Any:
    """A contiguous array of numba from a pointer and lengths."""
    kind = types.Array(dtype, len(shape), "C")
    model = context.data_model_manager[kind]
    found = ir.Constant(model.get_value_type(), None)  # zeros, for the owner of the memory
    size = ir.Constant(WORD, 1 if dtype == types.boolean else dtype.bitwidth // 8)
    strides, step = list[Any](), size
    for k, length in enumerate(reversed(shape)):
        strides.insert(0, step)
        step = builder.mul(step, length) if k + 1 < len(shape) else step
    for name, value in (("itemsize", size), ("data", data)):
        found = builder.insert_value(found, value, model.get_field_position(name))
    for name, values in (("shape", shape), ("strides", strides)):
        for axis, value in enumerate(values):
            found = builder.insert_value(found, value, [model.get_field_position(name), axis])
    total = shape[0]
    for length in shape[1:]:
        total = builder.mul(total, length)
    return builder.insert_value(found, total, model.get_field_position("nitems"))
