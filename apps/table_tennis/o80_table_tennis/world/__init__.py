"""The court: scene, table, net, racket and arm as the model file says, in one place."""
