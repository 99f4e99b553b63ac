"""Force-feedback laws, which compute the force that the hand feels, one law per file.

`law.py` contains the two halves of a law, `settings.py` the list of the laws (`LAWS`),
`local_model.py` the slave's half of model-mediated feedback, and `stability.py` the condition for
stability with a delay. The other files contain the energy tank (a limited amount of energy that a
law may give to the hand), and the observers that detect generated energy and oscillations.

To add a law, derive a class from `MasterHalf`, and add it to `LAWS` and its name to
`teleop.names.FeedbackName`.
"""
