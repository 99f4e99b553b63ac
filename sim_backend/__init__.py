"""Simulation of the telemanipulator, with models of specimens, drives, sensors and operators."""

from sim_backend.bodies import AnyBody, Changing, Relaxing
from sim_backend.body import Body, Law
from sim_backend.cube import Cube
from sim_backend.faults import FaultyRig
from sim_backend.force_master import ForceMaster
from sim_backend.force_palpation import ForcePalpation
from sim_backend.one_side import OneSidedRig
from sim_backend.operator_model import OperatorModel
from sim_backend.operators import ARM, AttentiveOperator, FreePalpation, MimickedSine, Operator
from sim_backend.paper_rig import (
    CUBES,
    DEPTH,
    FORCE_LAG,
    LOSS_TIME,
    TRANSMISSION,
    Setup,
    paper_setup,
)
from sim_backend.plant import Arm, Intention, Plant, PlantParameters
from sim_backend.pointer import PointerOperator
from sim_backend.sensors import Sensors
from sim_backend.simulated_rig import SimulatedRig
from sim_backend.slave_drives import ForceSlave
from sim_backend.transmission import RIGID, Transmission

__all__ = [
    "ARM",
    "CUBES",
    "DEPTH",
    "FORCE_LAG",
    "LOSS_TIME",
    "RIGID",
    "TRANSMISSION",
    "AnyBody",
    "Arm",
    "AttentiveOperator",
    "Body",
    "Changing",
    "Cube",
    "FaultyRig",
    "ForceMaster",
    "ForcePalpation",
    "ForceSlave",
    "FreePalpation",
    "Intention",
    "Law",
    "MimickedSine",
    "OneSidedRig",
    "Operator",
    "OperatorModel",
    "Plant",
    "PlantParameters",
    "PointerOperator",
    "Relaxing",
    "Sensors",
    "Setup",
    "SimulatedRig",
    "Transmission",
    "paper_setup",
]
