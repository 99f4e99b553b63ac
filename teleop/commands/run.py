"""`teleop run`: run one trial on the simulated rig or a hardware rig."""

from __future__ import annotations

from typing import Annotated

from cyclopts import Parameter

from teleop.commands.estimation_options import NEW_TRIAL, Estimation
from teleop.commands.live_options import NOT_LIVE, Live
from teleop.commands.one_trial import TABLES, Output
from teleop.commands.options import CONTROL, TRIAL
from teleop.commands.trial_options import DEFAULTS, Trial
from teleop.names import RealtimeName


def run(
    *,
    trial: Trial = DEFAULTS,
    yes: Annotated[bool, Parameter(group=TRIAL)] = False,
    live: Live = NOT_LIVE,
    realtime: Annotated[RealtimeName, Parameter(group=CONTROL)] = "try",
    estimation: Estimation = NEW_TRIAL,
    output: Output = TABLES,
) -> int:
    """Palpate, and estimate stiffness and damping of the environment at the same time.

    Ctrl-C decelerates the slave to rest. A second Ctrl-C stops the slave at once. In a terminal,
    Enter or Space is an emergency stop.

    Example: `teleop run --condition autonomous --cube hard --plot hard.png`

    Parameters
    ----------
    yes
        Arm the drives of a hardware rig without asking, for scripts.
    realtime
        Real-time settings, used with --clock real: real-time scheduling, locked memory, no garbage
        collection, and a processor for the loop only. require: fail if a setting is refused. try:
        apply the settings that the system allows. off: apply none.
    """
    from teleop.commands.live_options import for_pointer
    from teleop.commands.live_trials import run_from_page
    from teleop.commands.one_trial import TrialRunner
    from teleop.printable import print_error
    from teleop.settings.feedback_checks import check_feedback
    from teleop.trial.arming import arming_text, check_stated, is_armed

    with live.starting() as page:
        stated = trial.settings(estimation.given())
        settings = for_pointer(stated)
        check_stated(settings)
        if warning := check_feedback(settings):
            print_error(warning)
        output.check(settings, sources=(trial.config, trial.rig, trial.tare))
        live = live.requested([settings])
        by_page = live.arms([settings], yes)
        asked = settings.needs_arming and not (by_page or yes)
        if asked and not is_armed(settings.rig or settings.rig_name, arming_text(settings)):
            return 130
        with live.linked([settings], by_page, choose=by_page, page=page) as link:
            runner = TrialRunner(output, realtime, link, explained=asked)
            if link and by_page:
                return run_from_page(link, stated, runner, once=output.is_for_one_trial)
            return runner.run(settings)
