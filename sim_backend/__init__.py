"""Simulation of the telemanipulator: cubes, plant, sensors, operators, and the simulated rig."""

from sim_backend.cube import Cube
from sim_backend.faults import FaultyRig
from sim_backend.operators import ARM, FreePalpation, MimickedSine, Operator
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
from sim_backend.transmission import RIGID, Transmission

__all__ = [
    "ARM",
    "CUBES",
    "DEPTH",
    "FORCE_LAG",
    "LOSS_TIME",
    "RIGID",
    "TRANSMISSION",
    "Arm",
    "Cube",
    "FaultyRig",
    "FreePalpation",
    "Intention",
    "MimickedSine",
    "Operator",
    "Plant",
    "PlantParameters",
    "PointerOperator",
    "Sensors",
    "Setup",
    "SimulatedRig",
    "Transmission",
    "paper_setup",
]
