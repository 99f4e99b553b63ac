"""What shows a running trial besides the recorder, such as the live page or a notebook."""

from __future__ import annotations

from typing import Protocol

from teleop.settings.trial_settings import TrialSettings
from teleop.streams.stream import Stream


class Viewer(Protocol):
    """Shows the stream of a trial in another process."""

    def begin(self, settings: TrialSettings, stream: Stream) -> object:
        """Announce a trial, before its first tick."""

    def end_trial(self) -> None:
        """Announce the end of the trial."""
