"""The verbs behind the command line; each can be called from Python too."""
