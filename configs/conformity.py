"""Values from elsewhere held to a parameter's annotation, where there is no pydantic.

A process that receives parameters over the network checks them by the same annotations by which the
launcher has validated them: type and bounds.
"""

import re
from math import isfinite
from types import UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from annotated_types import Ge, Gt, Le, Len, Lt

from configs.parameters import Pattern


def conforms(value: object, annotation: Any) -> bool:
    """Whether a value is of a type and within its bounds; lists are tuples, floats finite.

    Raises:
        TypeError: an annotation that no parameter has.
    """
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        inner, *bounds = arguments
        return conforms(value, inner) and all(_within(value, bound) for bound in bounds)
    if origin in (Union, UnionType):
        return any(conforms(value, one) for one in arguments)
    if origin is Literal:
        return type(value) is str and value in arguments
    if origin is tuple:
        return isinstance(value, tuple) and all(conforms(one, arguments[0]) for one in value)
    if annotation is float:
        return type(value) is float and isfinite(value)
    return type(value) is annotation


def _within(value: Any, bound: object) -> bool:
    match bound:
        case Ge(ge=least):
            return bool(value >= least)
        case Gt(gt=below):
            return bool(value > below)
        case Le(le=most):
            return bool(value <= most)
        case Lt(lt=above):
            return bool(value < above)
        case Len(min_length=fewest, max_length=most):
            return len(value) >= fewest and (most is None or len(value) <= most)
        case Pattern(regex=regex, max_length=longest):
            fits = longest is None or len(value) <= longest
            return fits and re.search(regex, value) is not None
    raise TypeError(f"no bound of a parameter: {bound!r}")
