"""Starting on a task from what was learned on a simpler one."""
