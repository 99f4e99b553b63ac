"""A result of a trial, as the live page receives it."""

from __future__ import annotations

VALUES = [
    {
        "name": "stiffness",
        "symbol": "k",
        "value": "2034",
        "unit": "N/m",
        "low": "2013",
        "high": "2055",
        "usable": True,
    },
    {
        "name": "damping",
        "symbol": "b",
        "value": "3.1",
        "unit": "N s/m",
        "low": "-0.9",
        "high": "7.1",
        "usable": False,
    },
]
USE = "k can be used; b cannot, because damping is not resolved: its interval contains zero"
FILES = {name: f"/files/0/a.{name}" for name in ("report", "recording", "csv")}


def summary(estimates=("rls",), **changes):
    """Return the message `summary`, with other fields in `changes`."""
    depth = [1e-4 * i for i in range(100)]
    return {
        "type": "summary",
        "tracking": None,
        "recording": {"path": "recordings/a.mcap", "problem": None},
        "result": {"identifiable": True},
        "files": FILES,
        "shown": {
            "use": USE,
            "values": VALUES,
            "meaning": ["k is the tangent stiffness at 3 N"],
            "reasons": ["a remark on the result"],
            "headings": ["", "k [N/m]", "b [N s/m]", "held", "misfit"],
            "estimates": [
                [name, "2034 \u00b1 21", "3.1 \u00b1 0.9", "25%", "1%"] for name in estimates
            ],
        },
        "picture": {
            "depth": depth,
            "force": [2000.0 * x for x in depth],
            "fit": [None, *(2034.0 * x for x in depth[1:])],
            "tangent": {"depth": 5e-3, "force": 10.0, "k": 2034.0},
        },
        **changes,
    }


def failed(reason):
    """Return the message `summary` of a trial without k and b."""
    shown = {**summary()["shown"], "use": f"k and b cannot be used, because {reason}"}
    shown |= {"values": [], "meaning": [], "reasons": []}
    result = {"identifiable": False}
    return summary(shown=shown, result=result, picture=None, files={})
