"""Force-feedback laws, which compute the force that the hand feels, one law per file.

Other files contain the energy tank (a limited amount of energy that a law may give to the hand),
and the observers that detect generated energy and oscillations.
"""
