"""Parts of the thesis that stand beside the learners, each with a command of its own."""
