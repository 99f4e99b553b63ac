"""Tests never time: hypothesis has no deadline on a shared machine."""

from __future__ import annotations

from hypothesis import settings

settings.register_profile("shared machine", deadline=None)
settings.load_profile("shared machine")
