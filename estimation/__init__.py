"""Estimate the damping b and stiffness k of an environment online, with f = b v + k x.

In the docstrings of this package, "the paper" is T. Yamamoto, M. Bernhardt, A. Peer, M. Buss,
A. M. Okamura, "Techniques for environment parameter estimation during telemanipulation", BioRob
2008. Unless another source is named, a number in parentheses, such as (8), is the number of an
equation in the paper.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from estimation.public import *  # noqa: F403
    from estimation.public import __all__ as __all__


# A process that needs only one light module, such as `estimation.quantities`, does not load all
# estimators: the recorder and the live process start 0.35 s earlier. No public name may be the name
# of a module of this package, because the import of that module would hide it.
def __getattr__(name: str) -> Any:
    """Return a public name of the package, and load the estimators at its first use."""
    return getattr(import_module("estimation.public"), name)


def __dir__() -> list[str]:
    """Return also the public names, for the completion in a terminal or a notebook."""
    return [*globals(), *import_module("estimation.public").__all__]
