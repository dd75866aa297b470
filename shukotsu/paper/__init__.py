"""The paper's pipeline: joint solve, plane, wrist, metacarpals, replay and tip error (docs/method.md)."""
