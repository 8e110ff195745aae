"""The court: scene, table, net, racket and arm, read from the model file."""
