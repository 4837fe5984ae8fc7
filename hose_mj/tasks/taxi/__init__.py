"""The taxi task with several taxis."""
