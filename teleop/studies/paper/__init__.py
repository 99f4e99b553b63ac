"""The paper's experiment: its Table I and figures, reproduced, explained and taken further."""
