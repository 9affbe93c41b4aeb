"""Base classes of path shapes and formation offsets of the user's own.

    class Ellipse(OwnPath):        jet(s) -> jets of x and y, in the world [m]
    class Breathing(OwnOffset):    jet(s) -> jets of ahead and left, in axes that turn with the path

A jet is a value and its first three derivatives by s. A class that derives from `Parameters` alone
is taken for either.
"""

from configs.parameters import Parameters

Jet = tuple[float, float, float, float]
"""A value [m] and its first three derivatives by s."""


class OwnPath(Parameters):
    """A path shape Γ_0(s): a frozen dataclass of parameters with a method `jet(s)`."""

    __slots__ = ()


class OwnOffset(Parameters):
    """A formation offset l_i(s): a frozen dataclass of parameters with a method `jet(s)`."""

    __slots__ = ()
