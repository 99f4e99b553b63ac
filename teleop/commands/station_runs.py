"""Run one of two stations: begin the session, ask the person, run the trial."""

from __future__ import annotations

import math
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

from teleop.commands.estimation_options import EstimationOptions
from teleop.commands.live_options import LiveOptions
from teleop.commands.one_trial import OutputOptions, TrialRunner
from teleop.commands.trial_options import TrialOptions
from teleop.control.station_settings import StationSettings
from teleop.errors import InputError
from teleop.names import RealtimeName
from teleop.printable import print_error
from teleop.settings.feedback_checks import check_feedback
from teleop.station.address import parse_address
from teleop.station.agreement import document_of
from teleop.station.connection import connect, listen
from teleop.station.keys import read_key
from teleop.station.station import WAITING
from teleop.station.station_port import StationPort
from teleop.trial.arming import arming_text, check_stated, is_armed
from teleop.trial.station_waiting import Waiting


def run_station(
    rig: Path | None,
    given: StationSettings,
    address: str,
    key_file: Path,
    yes: bool,
    realtime: RealtimeName,
    live: LiveOptions,
    trial: TrialOptions,
    estimation: EstimationOptions,
    output: OutputOptions,
) -> int:
    """Run a station, and return the exit code."""
    if trial.rig:
        raise InputError("--rig: expected the rig file as the first argument")
    settings = replace(trial, rig=rig).settings({**estimation.given(), "station": given})
    if settings.clock != "real":
        raise InputError("clock virtual: two stations run in real time: expected real")
    check_stated(settings)
    if warning := check_feedback(settings, 0.0):
        print_error(warning)
    output.check(settings, sources=(trial.config, rig, trial.tare, key_file))
    secret, own = read_key(key_file), document_of(settings)
    with ExitStack() as stack:
        port = stack.enter_context(StationPort(parse_address(address), given.side == "slave"))
        begin = listen if given.side == "slave" else connect
        connection = begin(port, secret, own, print_error)
        number = f"{connection.session.number:016x}"
        settings = replace(settings, station=replace(given, session=number))
        if given.side == "slave" and trial.duration is None:
            # the master ends the trial; the person there may take a while to arm the drives
            most = connection.others["duration"] + WAITING
            settings = replace(settings, duration=most)
        limit = connection.longest
        most = f", round trip at most {limit * 1e3:.1f} ms" if limit < math.inf else ""
        print_error(f"session with {connection.text}{most}")
        asked = settings.needs_arming and not yes
        if asked and not is_armed(settings.rig or settings.rig_name, arming_text(settings)):
            return 130
        live = live.requested([settings])
        live.arms([settings], yes=True)  # the page shows and stops, but does not arm
        link = stack.enter_context(live.linked([settings], by_page=False, choose=False))
        waiting = stack.enter_context(Waiting(connection))
        code = TrialRunner(output, realtime, link, asked, waiting).run(settings)
        station = waiting.station
        if station and station.reason and not station.armed:
            raise InputError(f"{station.reason}: nothing was moved")
        return code
