"""System identification: reconstruction of a model from logs, its uncertainty, its validation, its goodness of fit."""
