"""Stage: how a study's skeleton models compare over its subjects."""
