"""Two stations: the master side and the slave side of a telemanipulator on two computers.

Each station runs the same control loop as a trial on one computer, with its own supervisor, limits,
watchdogs and recording, and moves its own drives only. The stations exchange one datagram per tick.
"""
